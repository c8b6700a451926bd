"""Paper 3, "Augmented bias model algorithm with application to target tracking" (2018): its target, its filters, and what they do with it."""
