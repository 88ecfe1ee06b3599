"""An engine of one's own: MuJoCo with floors that are more slippery than the plan believes."""

from dataclasses import dataclass, replace
from pathlib import Path

import trajopt
from trajopt.simulate.mujoco import MuJoCo


@dataclass(frozen=True)
class Slippery(MuJoCo):
    """What it does not say itself, it does as MuJoCo does."""

    share: float = 0.5

    @property
    def name(self) -> str:
        return f"mujoco at {self.share:.0%} of the friction"

    def open(self, model, stage, start, picture):
        friction = self.share * stage.scene.friction
        less = replace(stage, scene=replace(stage.scene, friction=friction))
        return super().open(model, less, start, picture)


problems = Path(__file__).parents[2] / "problems"
problem = trajopt.load_problem(problems / "powerbot" / "across_slope.toml")
solution = trajopt.solve(problem)
for share in (1.0, 0.5, 0.2):
    report = trajopt.validate(solution.trajectory, problem, engine=Slippery(share=share))
    print(
        f"{report.engine}: {100 * report.final_distance:.1f} cm off, slip {report.slip_share:.1%}"
    )
