"""Puts problems and examples into wheels, where ``trajopt examples`` finds them."""

from pathlib import Path
from shutil import copytree, ignore_patterns

from setuptools import setup
from setuptools.command.build_py import build_py


class WithExamples(build_py):
    def run(self) -> None:
        super().run()
        if self.editable_mode:
            return  # they are read from the checkout
        place = Path(self.build_lib, "trajopt", "shipped")
        for folder in ("problems", "docs/examples"):
            skipped = ignore_patterns("__pycache__")
            copytree(folder, place / folder, ignore=skipped, dirs_exist_ok=True)


setup(cmdclass={"build_py": WithExamples})
