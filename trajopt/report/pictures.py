"""The pictures of one run, each by its own module."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING

from trajopt.files import whole_file
from trajopt.report.convergence_picture import convergence_figure
from trajopt.report.files import made_folder
from trajopt.report.loads_picture import loads_figure, stands
from trajopt.report.path_picture import path_figure
from trajopt.report.physics_picture import physics_figure
from trajopt.report.profile_picture import profile_figure
from trajopt.report.style import in_style, save_figure
from trajopt.solution import Solution

if TYPE_CHECKING:
    from trajopt.simulate.check import ValidationReport


def save_pictures(
    solution: Solution, folder: str | FilePath, kind: str = "png"
) -> tuple[FilePath, ...]:
    """Draw path.png, where there is a path, convergence.png, where control points were searched,
    profile.png, where there is a trajectory, and loads.png, where its robot stands on three wheels
    or more; ``kind`` may be pdf or svg as well. Returns the files.

    Raises ArgumentError where the folder cannot be written.
    """
    place = made_folder(folder)
    with in_style():
        files = []
        if solution.path is not None:
            files.append(save_figure(path_figure(solution, solution.path), place / f"path.{kind}"))
        if solution.search is not None:
            figure = convergence_figure(solution, solution.search)
            files.append(save_figure(figure, place / f"convergence.{kind}"))
        timed = solution.trajectory
        if timed is not None:
            files.append(save_figure(profile_figure(solution, timed), place / f"profile.{kind}"))
            if stands(solution.problem.robot):
                files.append(save_figure(loads_figure(solution, timed), place / f"loads.{kind}"))
    return tuple(files)


def save_physics_picture(
    solution: Solution, report: ValidationReport, folder: str | FilePath, kind: str = "png"
) -> tuple[FilePath, ...]:
    """Draw physics.png (or of another ``kind``) and, where the engine made a picture, engine.png, and write view.html anew.
    Returns the pictures.

    Raises ArgumentError for a solution without a trajectory or a folder that cannot be written.
    """
    from trajopt.report.viewer.motion_page import write_view

    place = made_folder(folder)
    write_view(solution, place)
    with in_style():
        files = [save_figure(physics_figure(solution, report), place / f"physics.{kind}")]
    if report.recording.picture is not None:
        from matplotlib.image import imsave

        with whole_file(place / "engine.png") as part:
            imsave(part, report.recording.picture, format="png")
        files.append(place / "engine.png")
    return tuple(files)
