"""Compiled equations of motion: Pinocchio's results from C code generated once per robot; optional."""
