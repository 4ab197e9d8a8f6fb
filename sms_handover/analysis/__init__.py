"""Analysis of runs: signals over time, metrics per phase and arm, the paper's claims, tables.

``docs/analysis.md`` has an example to start from, ``docs/metrics.md`` defines every figure.
"""
