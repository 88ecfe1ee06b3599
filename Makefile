# Everything a fresh machine needs: Python 3.11 and make.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/ready

.DEFAULT_GOAL := help
.PHONY: help demo test test-all test-slurm check format lines docs schema sheet pictures clean

help:  ## what the targets do
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## /  -  /'

$(READY): pyproject.toml constraints.txt
	@echo "Setting up $(VENV): a few minutes on a fresh machine."
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[simulate,speed,sweep,optimizers,formats,video,docs,dev]'
	touch $@

demo: $(READY)  ## solve Table 5.3 and Scenario 1 forward35 (P1 and P2 free: it keeps clear of the step), check both in pybullet, write out/demo/
	$(BIN)/trajopt solve problems/smdw/table_5_3.toml --out out/demo/table_5_3
	$(BIN)/trajopt validate out/demo/table_5_3 --engine pybullet
	$(BIN)/trajopt solve problems/smdw/scenario_1_forward35.toml --set 'spline.free=["p1","p2"]' --out out/demo/scenario_1_forward35
	$(BIN)/trajopt validate out/demo/scenario_1_forward35 --engine pybullet
	@echo "Open out/demo/: view.html shows each run in the browser."

test: $(READY)  ## the tests (under 8 minutes on two cores)
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not slow"

test-all: $(READY)  ## the tests, long ones included
	$(BIN)/python -m pytest -n 2 --dist loadfile

test-slurm: $(READY)  ## sweeps on a real Slurm of one node, which it installs (Debian, as root), starts and stops
	tests/slurm/ci.sh $(BIN)/python

check: $(READY)  ## ruff, mypy and the import order
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

format: $(READY)  ## rewrite all Python files in the project's form
	$(BIN)/ruff format .

lines: $(READY)  ## lines of code of trajopt/, without blanks, comments, docstrings
	$(BIN)/python tests/code_lines.py trajopt

docs: $(READY)  ## the documentation as a site, out/docs/index.html
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs out/docs

schema: $(READY)  ## rewrite the JSON schemas of problem, robot and sweep files
	$(BIN)/trajopt schema problem --out problems/problem.schema.json --force
	$(BIN)/trajopt schema robot --out trajopt/robots/robot.schema.json --force
	$(BIN)/trajopt schema sweep --out problems/sweeps/sweep.schema.json --force

sheet: $(READY)  ## every figure on one sheet, out/contact_sheet.png, to be looked at
	$(BIN)/python -m benchmarks.contact_sheet

pictures: $(READY)  ## rewrite the pictures of README.md (the climb study's: after its sweep, see benchmarks/readme_pictures.py)
	$(BIN)/python -m benchmarks.readme_pictures
	$(BIN)/python -m benchmarks.time_scaling_pictures

clean:  ## remove everything that can be made again
	rm -rf $(VENV) out build *.egg-info
