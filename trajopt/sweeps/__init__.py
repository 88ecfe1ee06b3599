"""Sweeps: one function over many cases, on one machine or on a cluster, every finished case kept.

Nothing here knows what it runs. A **run function** takes a ``Case`` (``case["x"]``, ``case.seed``,
``case.rng()``) and returns numbers, texts, booleans, short lists and NumPy arrays by name.
``sweep`` (``sweeps.py``) runs one over cases made in Python, ``load_sweep`` (``sweepfile.py``)
reads cases and run function from a file:

``run = "module:function"``
    is imported and called as ``function(case)``.
``problem = "file.toml"``
    makes it ``function(case, problem)``: the problem of a case is the one in the file with the
    case's dotted names put in. ``run`` is then ``RUN_CASE`` where it is left out.

What a problem is, ``WITH_PROBLEM`` says, the other name that is imported only when it is needed:
``with_problem(function, file)`` returns the run function ``bound(case)``, with

``bound.func``
    the function, whose name stands in the identities of cases and in the record of runs,
``bound.content``
    the problem in plain values, which stand in the identities too,
``bound.check(case, spare)``
    which raises for names that no case can use, before anything runs: ``case`` is the first one,
    ``spare`` are its names without a dot that no formula of the file uses.

Public: ``sweep``, ``load_sweep``, ``Case`` (``cases.py``), ``open_store`` and ``Store``
(``store.py``), the engines of ``executors.py``, ``submit`` (``slurm.py``).
"""
