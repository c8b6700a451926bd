"""Real aircraft: the recorded paths, the filters that are held against them, and their scores."""
