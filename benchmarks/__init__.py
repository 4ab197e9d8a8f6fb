"""Benchmarks: each script answers one question, prints its tables and writes them to build/bench.

``make bench`` runs them all and renders docs/performance.md. One alone: ``python -m benchmarks.<script>``.
A new script calls ``publish(Result(...))`` and is listed in ``benchmarks/performance.py``.
"""
