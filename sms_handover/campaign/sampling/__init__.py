"""Sampling: the values of every case, each from a random stream of its own or from a design."""
