SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help install demo test quick torture docs iterate real xl330 so101 logs-of-so101 menagerie go2 check clean FORCE

VENV ?= .venv
GSL ?= $(VENV)/bin/gsl
PYTHON ?= $(shell command -v python3.11 || command -v python3)
INSTALLED := $(VENV)/.stamp
SITE := .venv-docs/.stamp
# Writes the help of all commands, which reads every class, into the cache: each would else take seconds the first time.
HELP := 'from gsl.cli import app, call; [call([info.name, "--help"]) for info in app.registered_commands if info.name]'

DEMO ?= name=demo beside=true force=true
DEMO_RUN = $(or $(patsubst name=%,%,$(filter name=%,$(DEMO))),quick-start)

help: ## Show this.
	@grep -hE '^[a-z]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z]+):.*## /make \1|/' | column -t -s '|'

install: $(INSTALLED) ## Install gsl, its experiments and its benchmarks from this folder into .venv.

demo: $(INSTALLED) ## Improve a walk for a "real" robot that the optimiser never touches; some minutes.
	$(GSL) iterate $(DEMO)
	$(GSL) render $(DEMO_RUN) out=runs/$(DEMO_RUN)/film.gif
	@echo "what there is to look at:"
	@find runs/$(DEMO_RUN) -type f \( -name '*.png' -o -name '*.gif' -o -name '*.md' -o -name '*.parquet' -o -name 'policies.json' -o -name 'report.html' \) | sort

# Two workers have two cores: threads of matrix products would only be in their way. Each begins with one half of the
# files and steals at the end, so that what a file makes for all of its tests is made once.
test: $(INSTALLED) ## Check the style, run the tests.
	$(VENV)/bin/ruff check
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/python -m pytest -q -n 2 --dist worksteal

quick: $(INSTALLED) ## Run the tests that take no simulation of seconds; a minute.
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/python -m pytest -q -n 2 --dist worksteal -m "not slow"

torture: $(INSTALLED) ## Kill commands, flip bits, feed rubbish, fill the disk; an hour (docs/reference/reliability.md).
	OPENBLAS_NUM_THREADS=1 $(VENV)/bin/python tests/support/torture.py $(TORTURE)

real: xl330 so101 menagerie go2 ## Diagnose logs of three real robots (docs/howto/shipped-logs.md); half an hour.

xl330: $(INSTALLED)
	$(GSL) import mapping=xl330_pendulum name=xl330
	$(GSL) diagnose real=xl330 sim=xl330_pendulum name=xl330 tolerance=0.0175
	$(GSL) cross-validate real=xl330 sim=xl330_pendulum name=xl330 tolerance=0.0175 by=kp checks=values servo=true

CHECKED := chirp_sweep, coupled_joints, hold_under_gravity, single_joint_rotation, single_joint_wrist_roll, \
	staircase_motion, step_response, velocity_ramp

logs-of-so101: $(INSTALLED)
	$(GSL) import mapping=so101_arm name=so101

so101: logs-of-so101
	$(GSL) diagnose real=so101 sim=so101 name=so101 'held_out={motion: [$(CHECKED)]}'
	$(GSL) cross-validate real=so101 sim=so101 name=so101 by=date
	$(GSL) cross-validate real=so101 sim=so101 name=so101_motions by=motion folds=4 servo=true

menagerie: logs-of-so101
	$(GSL) diagnose real=so101 sim=so101_menagerie name=so101_menagerie 'held_out={motion: [$(CHECKED)]}'
	$(GSL) cross-validate real=so101 sim=so101_menagerie name=so101_menagerie by=motion folds=4

go2: $(INSTALLED)
	$(GSL) import mapping=go2_in_air name=go2
	$(GSL) diagnose real=go2 sim=go2_in_air name=go2 tolerance=0.005

check: $(INSTALLED) ## Check style, format and types.
	$(VENV)/bin/ruff check
	$(VENV)/bin/ruff format --check
	$(VENV)/bin/mypy

docs: $(SITE) ## Build the documentation as a site, build/site; dead links fail.
	$(dir $(SITE))bin/mkdocs build --strict
	@echo "build/site/index.html"

# Beside gsl's own environment: its libraries are of the site alone.
$(SITE): pyproject.toml
	test -d $(@D) || $(PYTHON) -m venv $(@D)
	$(@D)/bin/python -m pip install --quiet 'mkdocs-material>=9.5,<10'
	touch $@

clean: ## Remove caches and build files; runs/ and the virtual environment stay.
	rm -rf .mypy_cache .pytest_cache .ruff_cache build dist *.egg-info
	find gsl experiments benchmarks tests -name __pycache__ -type d -prune -exec rm -rf {} +

$(INSTALLED): pyproject.toml Makefile
	test -d $(VENV) || $(PYTHON) -m venv $(VENV)
	$(VENV)/bin/python -m pip install --quiet 'torch>=2.4,<2.14'
	$(VENV)/bin/python -m pip install --quiet -e '.[dev,sweep,mujoco,rl,mesh]'
	$(VENV)/bin/python -c $(HELP) > /dev/null
	touch $@

# The chain of single commands. A stage runs when its configuration, the code or what it reads has changed, and a chain that
# failed goes on where it stopped. NAME, SIM, REAL, PRESET, RECIPE, SEED and ITERATIONS choose; ARGS goes to every command,
# COLLECT, TRAIN, OPTIMIZE and EVALUATE to one: make iterate NAME=mine PRESET=toy OPTIMIZE='grounding.alpha=0.5'

NAME ?= chain
SIM ?= nao_ideal
REAL ?= nao_worn
PRESET ?= quick
RECIPE ?= default
SEED ?= 1
ITERATIONS ?= 1

RUN := runs/$(NAME)
CHOSEN := $(RUN)/.chosen
export CHOICE := $(strip $(SIM) $(REAL) $(PRESET) $(RECIPE) $(SEED) $(ARGS) | $(COLLECT) | $(TRAIN) | $(OPTIMIZE) | $(EVALUATE))
ALWAYS := $(shell find gsl -name '*.py') $(wildcard conf/*/*.yaml) $(CHOSEN)

numbers := $(shell seq $(ITERATIONS))
home = $(RUN)/iteration_$(shell printf %02d $(1))
seed = $(shell echo $$(($(SEED) + 1000 * ($(1) - 1))))
before = $(if $(filter 1,$(1)),,$(call home,$(shell echo $$(($(1) - 1))))/evaluate)
initial = $(if $(call before,$(1)),initial=$(call before,$(1)))
done_before = $(if $(call before,$(1)),$(call before,$(1))/manifest.json)
force = $(if $(wildcard $@),force=true)
command = $(GSL) $(1) preset=$(PRESET) out=$(@D) $(force)

define iteration
$(call home,$(1))/collect_real/manifest.json: conf/collect.yaml $(ALWAYS) $(call done_before,$(1)) | $(INSTALLED)
	$$(call command,collect) recipe=$(RECIPE) role=real world=$(REAL) $(call initial,$(1)) seed=$(call seed,$(1)) $(ARGS) $(COLLECT)

$(call home,$(1))/collect_sim/manifest.json: conf/collect.yaml $(ALWAYS) $(call done_before,$(1)) | $(INSTALLED)
	$$(call command,collect) recipe=$(RECIPE) role=sim world=$(SIM) $(call initial,$(1)) seed=$(call seed,$(1)) $(ARGS) $(COLLECT)

$(call home,$(1))/train_forward/manifest.json: conf/train_forward.yaml $(ALWAYS) $(call home,$(1))/collect_real/manifest.json
	$$(call command,train-forward) recipe=$(RECIPE) data=$(call home,$(1))/collect_real seed=$(call seed,$(1)) $(ARGS) $(TRAIN)

$(call home,$(1))/train_inverse/manifest.json: conf/train_inverse.yaml $(ALWAYS) $(call home,$(1))/collect_sim/manifest.json
	$$(call command,train-inverse) recipe=$(RECIPE) data=$(call home,$(1))/collect_sim seed=$(call seed,$(1)) $(ARGS) $(TRAIN)

$(call home,$(1))/optimize/manifest.json: conf/optimize.yaml $(ALWAYS) $(call done_before,$(1)) \
		$(call home,$(1))/train_forward/manifest.json $(call home,$(1))/train_inverse/manifest.json
	$$(call command,optimize) recipe=$(RECIPE) world=$(SIM) $(call initial,$(1)) seed=$(call seed,$(1)) \
		grounding=gat grounding.forward_model=$(call home,$(1))/train_forward \
		grounding.inverse_model=$(call home,$(1))/train_inverse $(ARGS) $(OPTIMIZE)

$(call home,$(1))/evaluate/manifest.json: conf/evaluate.yaml $(ALWAYS) $(call home,$(1))/optimize/manifest.json
	$$(call command,evaluate) world=$(REAL) policies=$(call home,$(1))/optimize seed=$(call seed,$(1)) $(ARGS) $(EVALUATE)
endef

$(foreach number,$(numbers),$(eval $(call iteration,$(number))))

iterate: $(call home,$(lastword $(numbers)))/evaluate/manifest.json ## The chain of single commands, only what has changed; -j2 is safe.
	@echo "$(<D)"

$(CHOSEN):
	@mkdir -p $(@D)
	@echo "$$CHOICE" > $@

ifneq ($(file <$(CHOSEN)),$(CHOICE))
$(CHOSEN): FORCE
endif
