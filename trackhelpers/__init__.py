"""Helpers for re-doing four papers on tracking manoeuvring targets with filterpy."""
