"""Problems: one file with robot, scene and task.

Public: ``load_problem``, ``Problem`` (``robot``, ``scene``, ``limits``, ``job``, ``replace``),
``problem_schema``.
"""

from trajopt.problem.load import load_problem, problem_schema
from trajopt.problem.model import Problem

__all__ = ["Problem", "load_problem", "problem_schema"]
