"""The equations of motion as C code, made once for a robot: the same numbers as Pinocchio's, in less time.

Nothing here is needed to run: ``dynamics: pinocchio`` is the default. It needs CasADi and a C compiler.
"""
