# One command for each thing a user wants; everything lives in .venv/.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
BENCH := $(VENV)/installed-bench
SOAK := $(VENV)/installed-soak
PLATFORMS := $(VENV)/installed-platforms
export OMP_NUM_THREADS := 1
# two test processes more than processors: some wait for the processes that they start
TESTERS = $(shell $(PYTHON) -c 'import os; print(os.cpu_count() + 2)')
unexport PYTHONDONTWRITEBYTECODE  # each start would compile the package again, each test process all tests

.DEFAULT_GOAL := help
.PHONY: help train lint check test soak demo docs bench results platforms clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

$(INSTALLED): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "ibe_rl needs Python 3.11 or newer: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	touch $@

train: $(INSTALLED) ## install, then train with the defaults and watch it live
	$(BIN)/python train.py

demo: $(INSTALLED) ## a small trained agent explains an episode, in under a minute
	$(BIN)/python explain.py run=demo seed=1 context=right viewer=live output=runs/demo.rrd

docs: $(INSTALLED) ## build the documentation site in build/site; a warning is an error
	$(BIN)/python -m docs_site

lint: $(INSTALLED)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy

check: lint ## for every edit: format, lint, types and the fast tests, in a minute and a half
	$(BIN)/pytest --numprocesses auto --dist loadfile -m 'not slow and not soak'

test: lint ## everything: format, lint, types, all tests, in half an hour on two cores
	$(BIN)/pytest --numprocesses $(TESTERS) --dist loadfile --durations 20

$(SOAK): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[ray]'
	touch $@

soak: $(SOAK) ## what is too slow for every change: kills, many machines, long runs
	$(BIN)/pytest -m soak --timeout 3600 -o faulthandler_timeout=3700

$(BENCH): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[bench]'
	touch $@

bench: $(BENCH) ## measure against Stable-Baselines3 and the bare game, hours; PARTS=--short: ten minutes
	$(BIN)/python -m benchmarks $(PARTS)

results: $(INSTALLED) ## ten default trainings and the docs' tables made from them, hours; called again, it goes on
	$(BIN)/python -m benchmarks.documents $(PARTS)

$(PLATFORMS): $(INSTALLED)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[platforms]'
	touch $@

platforms: $(PLATFORMS) ## the systems and Pythons that are not here: wheels of all dependencies, types, lint
	$(BIN)/python -m benchmarks.platforms
	$(BIN)/ruff check --target-version py312 --extend-ignore UP .  # UP: what 3.11 cannot do yet
	$(BIN)/ruff check --target-version py313 --extend-ignore UP .
	$(BIN)/mypy --platform linux --python-version 3.12
	$(BIN)/mypy --platform linux --python-version 3.13
	$(BIN)/mypy --platform darwin --python-version 3.11
	$(BIN)/mypy --platform darwin --python-version 3.13

clean: ## remove the environment, not the runs
	rm -rf $(VENV)
