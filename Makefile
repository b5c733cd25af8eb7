# The Python for the environment, 3.11 or newer: make demo PYTHON=python3.12
PYTHON ?= python3
# Number of parallel test processes.
WORKERS ?= 2
# Seconds for each target of the fuzzer.
SECONDS_EACH ?= 60
# Seed of the blind benches; seeds from 1000 on are reserved for the final evaluation and not used before.
SEED ?= 1

VENV := .venv
BIN := $(VENV)/bin
RUNNABLE := $(VENV)/.rigsight-installed
DEVELOPMENT := $(VENV)/.development-installed
COMPILER := $(VENV)/.compiler-found
FUZZER_INSTALLED := $(VENV)/.fuzzer-installed
DOCS_INSTALLED := $(VENV)/.docs-installed
NEW_ENOUGH := import sys; sys.exit(sys.version_info < (3, 11))

# Nothing is byte-compiled in advance: Python compiles the few modules that are really used at their first import.
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile
# uv takes a third of pip's processor time. It does not read pip's settings (own index, own certificate), so if it fails,
# which it does quickly, pip is used.
UV_INSTALL := UV_HTTP_TIMEOUT=15 UV_HTTP_RETRIES=1 $(BIN)/python -m uv pip install --quiet --python $(BIN)/python
install = $(UV_INSTALL) $(1) 2>/dev/null || $(PIP_INSTALL) $(1)
NOW := date +%s

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test test-all coverage check release-check bench dist docs fuzz calibrate blind clean

help:  ## list the targets
	@grep -E '^[a-z-]+:.*##' Makefile | sed -E 's/^([a-z-]+):.*## */  make \1\t/' | expand -t 22

demo: $(RUNNABLE) $(COMPILER)  ## run the whole chain on the built-in virtual rig; results in demo/
	@begun=$$($(NOW)); $(BIN)/rigsight demo --out demo && echo "The demo took $$(($$($(NOW)) - begun)) s."

# Tests start dozens of processes; each would compile a thousand Python files again if Python could not cache them.
PYTEST := PYTHONDONTWRITEBYTECODE= $(BIN)/python -m pytest -n $(WORKERS) --dist worksteal

test: $(DEVELOPMENT)  ## run the tests that every change must pass; five to seven minutes on two processors
	@# Kernels compile in two thirds of the time; test-all takes the options that users have.
	@RIGSIGHT_CFLAGS=-O1 $(PYTEST) -m "not slow and not release"

test-all: $(DEVELOPMENT)  ## run all tests, with long studies, notebooks, wheel and browser
	@$(PYTEST)

coverage: $(DEVELOPMENT)  ## run the tests of `make test` and print which share of the lines they reach
	@RIGSIGHT_CFLAGS=-O1 $(PYTEST) -m "not slow and not release" --cov=rigsight --cov-report=term:skip-covered

release-check: check test-all docs  ## what a release must pass: checks, all tests, documentation; nightly too

check: $(DEVELOPMENT)  ## format, lint, docstrings, types, layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/python -m numpydoc.hooks.validate_docstrings src/rigsight/api/*.py
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(DEVELOPMENT)  ## measure the simulator against C and scipy, the time of a diagnosis, and exports against the simulator
	@$(BIN)/python benchmarks/engine.py
	@$(BIN)/python benchmarks/simulation.py
	@$(BIN)/python benchmarks/diagnosis.py
	@$(BIN)/python benchmarks/exports.py

dist: $(DEVELOPMENT)  ## build wheels and source distributions in dist/
	@$(BIN)/python -m hatchling build
	@cd bench && ../$(BIN)/python -m hatchling build -d ../dist

docs: $(DEVELOPMENT) $(DOCS_INSTALLED)  ## build the documentation site in build/site, links checked
	@# Not --quiet: suppressed warnings would not make a strict build fail.
	@NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict
	@echo "The site is in build/site; open build/site/index.html."

fuzz: $(DEVELOPMENT) $(FUZZER_INSTALLED)  ## fuzz everything that reads a file, a minute each; writes experiments/fuzzing/results.md
	@$(BIN)/python experiments/fuzzing/run.py --seconds $(SECONDS_EACH)

calibrate: $(DEVELOPMENT)  ## fit the calibration of probabilities again to its table of training trials
	@$(BIN)/python experiments/calibration/fit.py

blind: $(RUNNABLE) $(COMPILER)  ## run the blind bench; takes hours, continues where it was stopped; writes docs/blind.md
	@$(BIN)/rigsight blind --design standard --seed $(SEED) --out out/blind --markdown docs/blind.md

clean:  ## remove results and caches; the environment is kept (remove .venv to start from scratch)
	rm -rf demo out build dist .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis
	find src bench tests docs -name __pycache__ -type d -prune -exec rm -rf {} +

# Stamps are written last: an interrupted installation is continued by the next call.
# Runtime packages, pinned by the lock file, of which they are a third. hatchling, which builds the package, comes from
# there too, so that no unpinned build tool is downloaded. What the commands import is compiled here: where bytecode is not
# written (PYTHONDONTWRITEBYTECODE, usual in containers) every command would take seconds longer.
$(RUNNABLE): pyproject.toml bench/pyproject.toml requirements.lock
	@command -v $(PYTHON) >/dev/null || { echo "rigsight needs Python 3.11 or newer, and '$(PYTHON)' was not found. Name one: make $(MAKECMDGOALS) PYTHON=/path/to/python3.12" >&2; exit 1; }
	@test ! -x $(BIN)/python || $(BIN)/python -c '$(NEW_ENOUGH)' || { echo "$(VENV) holds a Python older than 3.11: remove it (rm -r $(VENV)) and call make again." >&2; exit 1; }
	@set -e; begun=$$($(NOW)); \
	 $(BIN)/python -m pip --version >/dev/null 2>&1 \
		|| { $(PYTHON) -c '$(NEW_ENOUGH)' || { echo "rigsight needs Python 3.11 or newer, '$(PYTHON)' is $$($(PYTHON) -V 2>&1). Name one: make $(MAKECMDGOALS) PYTHON=python3.12" >&2; exit 1; }; \
		     $(PYTHON) -m venv --clear $(VENV); }; \
	 echo "Installing rigsight and what it runs with into $(VENV) ..."; \
	 $(PIP_INSTALL) --only-binary uv "uv==0.13.8" 2>/dev/null || true; \
	 $(call install,--constraint requirements.lock hatchling); \
	 $(call install,--constraint requirements.lock --no-build-isolation --editable . --editable ./bench); \
	 PYTHONDONTWRITEBYTECODE= $(BIN)/python -c 'import rigsight.workflow.diagnose, rigsight.workflow.discover'; \
	 touch $@; \
	 echo "Installed in $$(($$($(NOW)) - begun)) s."

$(DEVELOPMENT): $(RUNNABLE) $(COMPILER)
	@echo "Installing what tests and checks need into $(VENV) ..."
	@$(call install,--requirement requirements.lock)
	@touch $@

# Simulations are compiled: if the machine has no C compiler, one is installed from the package index (0.1 GB).
$(COMPILER): $(RUNNABLE)
	@test -n "$$CC" || command -v cc >/dev/null || command -v gcc >/dev/null || command -v clang >/dev/null \
		|| { echo "No C compiler was found: installing one into $(VENV) ..."; \
		     $(call install,"ziglang==0.17.1"); }
	@touch $@

$(DOCS_INSTALLED): docs/requirements.lock $(DEVELOPMENT)
	@echo "Installing what builds the site into $(VENV) ..."
	@$(call install,--requirement docs/requirements.lock)
	@touch $@

# Wheels exist for Linux and Python 3.11 or 3.12; not in the lock file, because only the fuzzer needs it.
$(FUZZER_INSTALLED): $(DEVELOPMENT)
	@$(call install,"atheris==3.0.0")
	@touch $@
