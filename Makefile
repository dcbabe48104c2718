# Everything a developer does. Needs Python 3.11 or newer and package registries. Rust is installed
# into .rust where the machine has none. Nothing is installed outside .venv, .rust, target and the
# caches of pip and cargo.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
RL     := .venv-rl
QC     := .venv-qc
DEMO   ?= data/pinto
SEED   ?= 1
# Tests that ask for more processes than the machine has cores only get slower. With worksteal a process
# runs neighbouring tests, so that most fixtures of a module are made once.
PYTEST_FLAGS ?= -n 2 --dist worksteal
# Those of test-ci often wait, for servers, browsers, and processes that end: a third one works meanwhile.
CI_FLAGS ?= -n 3 --dist worksteal
# What is installed while the engine is built: requirements/dev.txt or requirements/demo.txt.
PACKAGES := dev
# The SIMD levels that are wanted, and those of the engine that is there.
LEVELS := $(or $(OVERTAKING_LEVELS),all)
BUILT   = $(shell cat $(VENV)/.engine 2>/dev/null)
# Arguments of `make test-pythons`: versions such as `3.12 3.13`; CI passes `newest --quick`.
PYTHONS ?=
# How often `make test-all` runs the property tests, each time with other examples.
ROUNDS ?= 20
# `make lock LOCK_FLAGS=--upgrade` moves every package to its newest version.
LOCK_FLAGS ?=

# Goals are made one after the other, so that the last line of `make test test-ci` is pytest's,
# whatever -j says. What a goal needs is made two at a time, or as many as -j says, with $(WIDE).
WIDE = $(if $(findstring -j,$(MAKEFLAGS)),,-j2) wide=yes
ifndef wide
.NOTPARALLEL:
endif
MAKEFLAGS += --no-print-directory
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

# What runs belongs to .venv, not to an environment that happens to be active.
unexport PYTHONPATH PYTHONHOME
# Nearly every process would compile all modules anew, which takes longer than what most of them do.
unexport PYTHONDONTWRITEBYTECODE
# What PyO3 is to know of Python. Maturin would write a file of its own, and compile the binding again.
export PYO3_CONFIG_FILE := $(CURDIR)/crates/overtaking-py/pyo3-config.txt
# Pyright would ask the package registry whether a newer version exists.
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

# Bytecode is written when a module is first imported, most of it never.
# A lock file is complete, so pip need not look for dependencies.
INSTALL := $(BIN)/python -m pip install --disable-pip-version-check --no-compile --require-hashes --no-deps
# Cargo counts its own processes: those of `make` would leave it one.
CARGO   := MAKEFLAGS= setup/with_rust.sh cargo
CRATES := $(shell find crates -type f)
COMPILE := uv pip compile --universal --python-version 3.11 --generate-hashes \
           --no-header --no-emit-index-url --no-emit-find-links --quiet $(LOCK_FLAGS)
LOCK    := $(COMPILE) pyproject.toml

.PHONY: help demo test test-ci test-pythons test-lowest test-docs test-qc test-rl test-all checks check check-python check-rust test-rust test-python release bench docs site viewer stub check-viewer \
        lock build dev qc rl format clean more-levels

help:  ## List what can be made
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1|\2/p' $(firstword $(MAKEFILE_LIST)) \
	  | awk -F'|' '{ printf "%-18s %s\n", $$1, $$2 }'

# Only the SIMD level of this CPU, which takes a third of the time to build; `dev` adds the others.
demo: export OVERTAKING_LEVELS := native
demo: build  ## Generate the paper's 276 simulations twice, as it tells them and with physical weather, and report both
	$(BIN)/overtaking generate --profile pinto2023 -n 276 --seed $(SEED) --out $(DEMO)-study \
	  $(if $(wildcard $(DEMO)-study),--resume)
	$(BIN)/overtaking generate --profile pinto2023-physical -n 276 --seed $(SEED) --out $(DEMO) \
	  $(if $(wildcard $(DEMO)),--resume)
	$(BIN)/overtaking stats $(DEMO)-study
	$(BIN)/overtaking stats $(DEMO)
	@# A report is drawn on one core; the other one does the rest meanwhile.
	$(BIN)/overtaking report --quiet $(DEMO) & report=$$!; \
	  $(BIN)/overtaking reproduce pinto2023 --num-replicates 10 --seed $(SEED) --out $(DEMO)-study/reproduction && \
	  $(BIN)/overtaking film $(DEMO) && wait $$report
	$(BIN)/overtaking show $(DEMO) 3
	@echo "The study's experiment is in $(abspath $(DEMO))-study, the same scenes with physical weather in $(abspath $(DEMO)):"
	@echo "tables, report/index.html, films/; reproduction/index.html has the study, its experiment and ours side by side."

test: checks test-python  ## Checks, then the tests of both languages but those of test-ci

# One core compiles the engine, most of the time a single crate of it. Meanwhile the other one
# installs packages, and then runs the checks that need no engine.
checks:
	@$(MAKE) $(WIDE) check-python site check-rust test-rust check-viewer

test-ci: dev  ## The tests that take long: kills, memory, Ray, CARLA, SUMO, browser; CI runs them too
	$(BIN)/python -m pytest $(CI_FLAGS) -m "ci and not soak"

test-pythons: $(VENV)/.engine  ## Install the package for each supported Python without lock files, run the examples of its help and make demo
	$(BIN)/python tests/try_pythons.py $(PYTHONS)

test-lowest: $(VENV)/.engine  ## The same on 3.11 with the lowest versions that pyproject.toml permits (needs uv)
	$(BIN)/python tests/try_pythons.py --lowest 3.11

test-qc: dev qc  ## Ask the checkers of ASAM for issues of exported files, in .venv-qc
	$(BIN)/python -m pytest -m qc

test-docs: dev  ## Run the long blocks of the documentation, which takes half an hour
	$(BIN)/python -m pytest $(PYTEST_FLAGS) -m docs

# What other tests import is not in .venv-rl, so pytest must not look at them.
test-rl: rl  ## Train drivers and drive with them, in .venv-rl, which is some gigabytes large
	$(RL)/bin/python -m pytest -m rl tests/rl

test-all: test test-ci  ## All of that, then random properties, hostile sizes, soaks and mutations; hours
	$(BIN)/python -m pytest $(PYTEST_FLAGS) -m soak
	for round in $$(seq $(ROUNDS)); do \
	  $(BIN)/python -m pytest $(PYTEST_FLAGS) --hypothesis-profile=random tests/properties || exit 1; done
	$(BIN)/python benchmarks/kill_resume.py
	$(BIN)/python benchmarks/carla_fuzz.py
	$(BIN)/python benchmarks/carla_soak.py
	$(BIN)/python benchmarks/extensions.py
	$(BIN)/python benchmarks/mutations.py
	$(BIN)/python benchmarks/flips.py

check:  ## Format, lint, types, layers, spelling, vague words, links, the page; changes nothing
	@$(MAKE) $(WIDE) check-python site check-rust check-viewer

# Sources are read, not imported.
check-python: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/typos
	PYTHONPATH=src $(BIN)/lint-imports --no-cache --no-logo
	$(BIN)/python tests/contract/test_language.py
	@# On both cores where one is idle; the engine, if it is being compiled, is waited for longer.
	nice $(BIN)/pyright --threads 2

# With the profile and the feature of the engine, so that build scripts and macros are there.
check-rust: $(VENV)/.engine
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets --locked --features pyo3/extension-module \
	  -- -D warnings

# Only the crates without Python in them have tests of their own (default-members); the binding is tested
# from Python, as it has to be loaded by an interpreter.
test-rust: $(VENV)/.engine
	$(CARGO) test --release --locked

test-python: dev
	$(BIN)/python -m pytest $(PYTEST_FLAGS) -m "not ci and not docs and not soak and not qc and not rl"

release: dev  ## Data sets to learn from, in build/release, checked by content hash
	$(BIN)/python benchmarks/release.py --out build/release

bench: dev  ## Measure the speed against its peers
	$(BIN)/python benchmarks/run.py

viewer: dev  ## Build the page of `overtaking view` from viewer/src, with Node from the package registry
	$(BIN)/python viewer/make.py

stub: dev  ## Write the stub of the compiled engine, src/overtaking/_core.pyi, from its Rust sources
	$(BIN)/python crates/engine_stub.py

check-viewer: $(VENV)/.dev
	$(BIN)/python viewer/make.py --check

docs: dev  ## Write the pages and pictures that are made from the project anew
	$(BIN)/python docs/generate.py

build:  ## Make .venv with the compiled engine and the packages that make demo needs
	@$(MAKE) $(WIDE) --silent PACKAGES=$(if $(wildcard $(VENV)/.dev),dev,demo) $(VENV)/.build

dev:  ## The same with the packages that developers need
	@$(MAKE) $(WIDE) --silent $(VENV)/.build

qc: $(QC)/.qc  ## Make .venv-qc, with the checkers of ASAM

rl: build $(RL)/.rl  ## Make .venv-rl, with what drivers are trained with

format: dev  ## Format all code, and fix what the linter can fix
	$(BIN)/ruff check --fix-only --quiet .
	$(BIN)/ruff format .
	$(CARGO) fmt --all

site: $(VENV)/.build  ## Build the documentation as a site, target/docs/site; fails if a link leads nowhere
	$(BIN)/python docs/site.py

lock:  ## Write requirements/*.txt anew (needs uv)
	$(LOCK) -o requirements/runtime.txt
	$(LOCK) -c requirements/runtime.txt --extra all --group tools -o requirements/dev.txt
	$(LOCK) -c requirements/dev.txt $(addprefix --extra ,plots stats video) --group build -o requirements/demo.txt
	$(LOCK) -c requirements/dev.txt $(addprefix --extra ,gym onnx) --group rl -o requirements/rl.txt
	$(COMPILE) --group qc -o requirements/qc.txt
	$(COMPILE) --group pip -o requirements/pip.txt
	@if grep -nE '://|--(extra-)?index-url|--find-links' requirements/*.txt; then \
	  echo "requirements/*.txt: a download address was written into a lock file" >&2; exit 1; fi

clean:  ## Remove what was built, except the caches of pip and cargo and the data
	rm -rf $(VENV) $(QC) $(RL) target dist viewer/node_modules .pytest_cache .ruff_cache .hypothesis src/overtaking/_core*.so
	find src tests benchmarks -name __pycache__ -prune -exec rm -rf {} +

# Each stamp is touched last, so an interrupted step is done again.
$(VENV)/.python: requirements/pip.txt
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || \
	  { python=$$(setup/find_python.sh "$(PYTHON)") && "$$python" -m venv --clear $(VENV); }
	@$(INSTALL) --quiet -r $<
	@touch $@

$(QC)/.qc: requirements/qc.txt | $(VENV)/.python
	@$(BIN)/python -m venv $(QC)
	@echo "installing the packages of $< into $(QC)"
	@$(QC)/bin/python -m pip install --disable-pip-version-check --no-compile --require-hashes -r $<
	@touch $@

# The same editable package: its engine fits every Python.
$(RL)/.rl: requirements/rl.txt | $(VENV)/.python
	@$(BIN)/python -m venv $(RL)
	@echo "installing the packages of $< into $(RL)"
	@$(RL)/bin/python -m pip install --disable-pip-version-check --no-compile --require-hashes -r $<
	@cp -r $(VENV)/lib/python3.*/site-packages/overtaking* $(RL)/lib/python3.*/site-packages/
	@touch $@

$(VENV)/.demo $(VENV)/.dev: $(VENV)/.%: requirements/%.txt | $(VENV)/.python
	@echo "installing the packages of $< into $(VENV)"
	@$(INSTALL) -r $<
	@touch $@

$(VENV)/.engine: $(CRATES) Cargo.toml Cargo.lock $(if $(filter all $(LEVELS),$(BUILT)),,more-levels) \
    | $(VENV)/.python
	@echo "building the engine"
	@$(CARGO) build --release --locked --package overtaking-py --features pyo3/extension-module
	@echo $(LEVELS) > $@

# What `make demo` built has one SIMD level.
more-levels:

# Maturin, which pip starts, finds the engine built. Only the compiled module has to be built again
# when Rust code changes.
$(VENV)/.build: $(VENV)/.engine pyproject.toml | $(VENV)/.$(PACKAGES)
	@PATH="$(CURDIR)/$(BIN):$$PATH" MAKEFLAGS= setup/with_rust.sh \
	  $(BIN)/python -m pip install --quiet --no-build-isolation --no-deps --editable .
	@touch $@
