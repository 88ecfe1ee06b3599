"""Comparison of optimizers: problems, runs in a resumable store, tables, page.

Public: ``comparison.load_bench``, ``page.write_report``.
"""
