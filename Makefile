# The Python that makes the environment; 3.11 or newer: make demo PYTHON=python3.12
PYTHON ?= python3
# Test processes side by side.
WORKERS ?= 2
# For each target of the fuzzer.
SECONDS_EACH ?= 60
# Seed of the blind benches; those from 1000 on are kept for the last word and never looked at before.
SEED ?= 1

VENV := .venv
BIN := $(VENV)/bin
DEPENDENCIES := $(VENV)/.dependencies-installed
INSTALLED := $(VENV)/.rigsight-installed
COMPILER := $(VENV)/.compiler-found
FUZZER_INSTALLED := $(VENV)/.fuzzer-installed
DOCS_INSTALLED := $(VENV)/.docs-installed
NEW_ENOUGH := import sys; sys.exit(sys.version_info < (3, 11))

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test check bench docs fuzz blind blind-small clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/^([a-z-]+):.*## */  make \1\t/' | expand -t 20

demo: $(INSTALLED)  ## run the whole chain on the built-in virtual rig; results in demo/
	@$(BIN)/rigsight demo --out demo

test: $(INSTALLED)  ## run all tests
	@$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

check: $(INSTALLED)  ## format, lint, types, layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(INSTALLED)  ## measure the simulator against C and scipy, the time of a diagnosis, and exports against the simulator
	@$(BIN)/python benchmarks/engine.py
	@$(BIN)/python benchmarks/simulation.py
	@$(BIN)/python benchmarks/diagnosis.py
	@$(BIN)/python benchmarks/exports.py

docs: $(INSTALLED) $(DOCS_INSTALLED)  ## build the documentation site in build/site, links checked
	@# Not --quiet: what is not told does not count as a warning, and would not end a strict build.
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "The site is in build/site; open build/site/index.html."

fuzz: $(INSTALLED) $(FUZZER_INSTALLED)  ## fuzz everything that reads a file, a minute each; writes experiments/fuzzing/results.md
	@$(BIN)/python experiments/fuzzing/run.py --seconds $(SECONDS_EACH)

blind-small: $(INSTALLED)  ## diagnose 202 drawn rigs whose effect is withheld; hours, goes on where it was stopped
	@$(BIN)/rigsight blind --design small --seed $(SEED) --out out/blind-small

blind: $(INSTALLED)  ## the standard blind bench, 244 rigs; hours, goes on where it was stopped; writes docs/blind.md
	@$(BIN)/rigsight blind --design standard --seed $(SEED) --out out/blind --markdown docs/blind.md

clean:  ## remove results and caches; the environment stays (remove .venv to start afresh)
	rm -rf demo out build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find src tests docs -name __pycache__ -type d -prune -exec rm -rf {} +

# Stamps are written last: an interrupted installation is taken up again by the next call.
$(DEPENDENCIES): requirements.lock
	@command -v $(PYTHON) >/dev/null || { echo "rigsight needs Python 3.11 or newer, and '$(PYTHON)' was not found. Name one: make $(MAKECMDGOALS) PYTHON=/path/to/python3.12" >&2; exit 1; }
	@test ! -x $(BIN)/python || $(BIN)/python -c '$(NEW_ENOUGH)' || { echo "$(VENV) holds a Python older than 3.11: remove it (rm -r $(VENV)) and call make again." >&2; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 \
		|| { $(PYTHON) -c '$(NEW_ENOUGH)' || { echo "rigsight needs Python 3.11 or newer, '$(PYTHON)' is $$($(PYTHON) -V 2>&1). Name one: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }; \
		     $(PYTHON) -m venv --clear $(VENV); }
	@echo "Installing pinned dependencies into $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -r requirements.lock
	@touch $@

# Simulations are compiled: where the machine has no C compiler, one comes from the package index (a tenth of a gigabyte).
$(COMPILER): $(DEPENDENCIES)
	@test -n "$$CC" || command -v cc >/dev/null || command -v gcc >/dev/null || command -v clang >/dev/null \
		|| { echo "No C compiler was found: installing one into $(VENV) ..."; \
		     $(BIN)/python -m pip install --quiet --disable-pip-version-check "ziglang==0.17.1"; }
	@touch $@

# hatchling comes from the lock, so that no unpinned build tool is fetched.
$(INSTALLED): pyproject.toml $(DEPENDENCIES) $(COMPILER)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

$(DOCS_INSTALLED): docs/requirements.lock $(DEPENDENCIES)
	@echo "Installing what builds the site into $(VENV) ..."
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check -r docs/requirements.lock
	@touch $@

# For Linux and Python 3.11 or 3.12 there are wheels; no part of the lock, because nothing but the fuzzer needs it.
$(FUZZER_INSTALLED): $(DEPENDENCIES)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check "atheris==3.0.0"
	@touch $@
