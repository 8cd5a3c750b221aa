# Everything here sets itself up: `make reproduce` and `make test` work on a fresh machine with Python 3.11 or newer.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.SUFFIXES:
MAKEFLAGS += --no-builtin-rules
SHELL := /bin/sh

VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.installed
# Any Python >= 3.11 will do; `make PYTHON=...` chooses one.
FITS := import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in python3 python3.13 python3.12 python3.11; do \
	"$$p" -c '$(FITS)' 2>/dev/null && { echo "$$p"; break; }; done)
WORKERS ?= 2
SEED ?= 1
CASES ?= 300

# What results are made from, and what only their pages are made from.
PAGE := $(sort $(shell find discovery/report -type f ! -name '*.pyc'))
CONTROL := $(sort $(shell find benchmarks/closed_loop -type f ! -name '*.pyc'))
DASHBOARD := $(sort $(shell find benchmarks/dashboard -type f ! -name '*.pyc'))
PAPER := $(sort $(shell find benchmarks/paper -type f ! -name '*.pyc'))
CODE := $(sort $(filter-out discovery/report/%,$(shell find discovery -name '*.py' -o -name '*.txt')) \
	$(wildcard datasets/discovery_datasets/*.py datasets/discovery_datasets/*.toml)) requirements.lock
TWIN := Simulated: no recording of a very flexible arm was ever published. A geometrically exact beam stands in for the rig.

# The measured circuit is run where its recording is at hand; it belongs to others and is not in this repository.
SILVERBOX := $(shell IFS=:; set -f; named="$(DISCOVERY_DATA)"; for d in $$named "$${XDG_CACHE_HOME:-$$HOME/.cache}/discovery/measured" "$$HOME/Library/Caches/discovery/measured"; do \
	[ -f "$$d/silverbox/SNLS80mV.mat" ] && { echo silverbox; break; }; done)

HIDDEN := arm_coulomb arm_delay arm_tilt
PAGES := reports/arm/report.html reports/paper/report.html $(if $(SILVERBOX),reports/silverbox/report.html)
LOOPS := $(HIDDEN:%=reports/%/report.html)

.PHONY: help reproduce measured test test-long lint bench calibration closed-loop audit blind faults kills scale systems growth datasets docs docs-site linkcheck lock clean distclean setup
help: ## Show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

setup: $(READY) ## Make the virtual environment in .venv with the pinned dependencies

$(READY): requirements.lock pyproject.toml
	@[ -n "$(PYTHON)" ] && $(PYTHON) -c '$(FITS)' || { echo "make: no Python 3.11 or newer with venv and pip was found$(if $(PYTHON), in $(PYTHON)). Install one (Debian: apt-get install python3 python3-venv), or name it: make PYTHON=/path/to/python3" >&2; exit 1; }
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || { echo "making $(VENV) with $(PYTHON)"; $(PYTHON) -m venv --clear $(VENV); }
	@echo "installing the pinned dependencies"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

reproduce: reports/index.html ## Run everything on the committed recordings; the result is reports/index.html
	@echo "open $<"

reports/arm/results.json: datasets/arm/rig.toml $(wildcard datasets/arm/*.csv) $(CODE) | $(READY)
	@echo "arm: the whole pipeline"
	@$(BIN)/discovery run datasets/arm/rig.toml --train datasets/arm/train_paper.csv --train datasets/arm/train_large.csv \
		--holdout datasets/arm/holdout_inside.csv --holdout datasets/arm/holdout_beyond.csv --seed $(SEED) --note "$(TWIN)" --out $(@D)

reports/silverbox/results.json: datasets/silverbox/rig.toml $(CODE) | $(READY)
	@echo "Silverbox: the whole pipeline"
	@$(BIN)/discovery run $< --seed $(SEED) --note "Measured on an electronic circuit in another laboratory." --out $(@D)

# A run writes its page too; it is written again only when something is newer.
reports/%/report.html: reports/%/results.json $(PAGE)
	@[ -z "$$(find $^ -newer $@ 2>&1)" ] || $(BIN)/discovery report $(@D)
	@touch $@

# A loop writes loop.json and its page, and is so short that both are made again with either.
$(LOOPS): reports/%/report.html: datasets/%/rig.toml datasets/%/train_paper.csv datasets/%/train_large.csv datasets/%/holdout_inside.csv $(CODE) $(PAGE) | $(READY)
	@echo "$*: the closed loop"
	@$(BIN)/discovery loop $< --train datasets/$*/train_paper.csv --train datasets/$*/train_large.csv \
		--holdout datasets/$*/holdout_inside.csv --seed $(SEED) --out $(@D)

# Two controllers of the twin, on the models of one of these loops.
reports/closed_loop/report.html: reports/arm_delay/report.html $(CONTROL)
	@echo "a controller from the discovered model"
	@$(BIN)/python -m benchmarks.closed_loop reports $(@D) --workers $(WORKERS) --again

# A study is not repeated while the code that it depends on is the same.
reports/paper/studies.json: $(CODE) $(PAPER) | $(READY)
	@echo "the source paper: every equation, figure and claim"
	@$(BIN)/python -m benchmarks.paper $(@D)

reports/paper/report.html: reports/paper/studies.json $(PAGE) $(PAPER)
	@[ -z "$$(find $^ -newer $@ 2>&1)" ] || $(BIN)/python -m benchmarks.paper $(@D)
	@touch $@

reports/index.html: $(PAGES) $(LOOPS) reports/closed_loop/report.html $(PAGE) $(DASHBOARD)
	@$(if $(SILVERBOX),:,echo "the Silverbox is left out: its recording is not here. Set DISCOVERY_DATA to the folder that holds silverbox/SNLS80mV.mat (or: $(BIN)/discovery data fetch silverbox/SNLS80mV.mat) and make again")
	@$(BIN)/python -m benchmarks.dashboard reports

.PRECIOUS: reports/measured/%/results.json
# The rigs whose recordings are at hand, the largest first, two side by side. A rig that fails does not stop the others,
# and without any recording nothing is done. A rig is run again when its file or the code changes. What is worse than
# known.toml of its set allows fails the target by name and value. The posterior is left out: the page compares estimates
# and errors.
measured: $(READY) ## Run every measured set that is at hand (DISCOVERY_DATA); the result is reports/measured/index.html
	@rigs="$$($(BIN)/python -m benchmarks.measured list datasets)" || exit 1; [ -n "$$rigs" ] || exit 0; \
	$(MAKE) --no-print-directory -k -j $(WORKERS) $$(for rig in $$rigs; do echo "reports/measured/$$rig/report.html"; done); status=$$?; \
	page="$$($(BIN)/python -m benchmarks.measured page datasets reports/measured)" || status=1; \
	[ -z "$$page" ] || echo "open $$page"; exit $$status

reports/measured/%/results.json: datasets/%.toml $(CODE) | $(READY)
	@echo "$*"
	@$(BIN)/discovery run $< --no-posterior --quiet --seed $(SEED) --note "Measured in another laboratory." --out $(@D) >/dev/null

test: $(READY) ## Run the tests (about six minutes on two idle cores)
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder -m "not slow"

test-long: $(READY) ## Run the longer studies
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder -m slow

lint: $(READY) ## Check style, types and the layers of the package
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

bench: $(READY) ## Measure speed and recovery beside peers; the figures are written to reports/bench
	@mkdir -p reports/bench
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r benchmarks/requirements.lock || \
		echo "the peers could not be installed; those that are missing are left out with their reason"
	@for b in benchmarks/*.py; do echo "== $$b"; $(BIN)/python "$$b" "reports/bench/$$(basename "$$b" .py).json" || exit 1; done

closed-loop: reports/closed_loop/report.html ## Control the twin by the declared and by the discovered model; docs/CLOSED_LOOP.md
	$(BIN)/python -m benchmarks.closed_loop reports reports/closed_loop --page docs/CLOSED_LOOP.md

# The file is written when the service has answered: a fault found fails, a service out of reach does not.
audit: ## Look the pinned dependencies up in the list of known vulnerabilities (needs the network)
	@mkdir -p build && rm -f build/audit.json
	@{ $(PYTHON) -m venv --clear build/audit && build/audit/bin/python -m pip install --quiet --disable-pip-version-check pip-audit && \
		build/audit/bin/pip-audit -r requirements.lock --require-hashes --disable-pip --timeout 10 --progress-spinner off \
		-f json -o build/audit.json; } || { [ ! -s build/audit.json ] && echo "skipped: the service of vulnerabilities cannot be reached"; }

calibration: $(READY) ## Calibrate the posteriors: ranks of truths, coverage over manoeuvres (half an hour)
	$(BIN)/python -m benchmarks.calibration.run reports/calibration --workers $(WORKERS) --seed $(SEED)

# Finished cases are kept, so an interrupted benchmark goes on where it was; `make blind CASES=60` is a short one. The
# rough world has errors of the model beside the effect. Its free decays are over where a last third begins, so there the
# loop is given the hold-out, as its user would.
blind: $(READY) ## Generate blind cases with sealed truth, run the loop and its peers on them, and score (hours)
	$(BIN)/python -m benchmarks.blind.base reports/blind --seed $(SEED) --workers $(WORKERS)
	$(BIN)/python -m benchmarks.blind.generate reports/blind --cases $(CASES) --seed $(SEED) --workers $(WORKERS)
	$(BIN)/python -m benchmarks.blind.run reports/blind --workers $(WORKERS) --peers
	$(BIN)/python -m benchmarks.blind.score reports/blind
	$(BIN)/python -m benchmarks.blind.generate reports/blind_rough --world rough --cases $(CASES) --seed $(SEED) --workers $(WORKERS)
	$(BIN)/python -m benchmarks.blind.run reports/blind_rough --workers $(WORKERS) --holdout
	$(BIN)/python -m benchmarks.blind.score reports/blind_rough

faults: $(READY) ## Try the corpus of bad input and faults; docs/FAULTS.md (half an hour)
	$(BIN)/python -m benchmarks.faults reports/faults --workers $(WORKERS) --page docs/FAULTS.md

kills: $(READY) ## Kill commands at random moments and give them again; docs/FAULTS.md (half an hour)
	$(BIN)/python -m benchmarks.kills reports/kills --page docs/FAULTS.md

scale: $(READY) ## Do a campaign of a thousand rigs whose workers are killed; docs/FAULTS.md
	$(BIN)/python -m benchmarks.scale reports/scale --workers $(WORKERS) --page docs/FAULTS.md

systems: $(READY) ## Run the loop on simulated machines that lack one effect; the table is in reports/systems
	$(BIN)/python -m benchmarks.systems reports/systems --seed $(SEED)

growth: $(READY) ## Measure CPU time and memory of long recordings; the table is in reports/growth
	$(BIN)/python -m benchmarks.growth reports/growth --run

datasets: $(READY) ## Simulate the twin's recordings again
	$(BIN)/python -m discovery_datasets.generate datasets

# What is made from the results of `make reproduce` is made again where they are at hand, and stays as it is elsewhere.
RESULTS := $(wildcard reports/arm/trajectories.nc)
docs: docs/CATALOGUE.md docs/RIG_FILE.md docs/images/architecture.svg docs/images/in_out.png docs/images/page.png docs/images/way.svg $(if $(RESULTS),docs/images/arm.png) ## Write the generated pages, the pictures and the README's table again
	$(BIN)/python docs/results_table.py reports README.md

docs/CATALOGUE.md: $(wildcard discovery/effects/*.py) discovery/mechanics/upgrades.py docs/catalogue_page.py | $(READY)
	$(BIN)/python docs/catalogue_page.py $@

docs/RIG_FILE.md: $(wildcard discovery/rigs/*.py discovery/rigs/systems/*.toml) discovery/recordings/file_signals.py docs/rig_file_page.py | $(READY)
	$(BIN)/python docs/rig_file_page.py $@

docs/images/architecture.svg: docs/draw_architecture.py | $(READY)
	$(BIN)/python $< $@

docs/images/arm.png: docs/draw_result.py $(RESULTS) | $(READY)
	$(BIN)/python $< reports/arm $@

docs/images/in_out.png: docs/draw_in_out.py $(wildcard datasets/spring_bench/*) | $(READY)
	$(BIN)/python $< $@

docs/images/page.png: docs/draw_page.py $(wildcard datasets/spring_bench/*) $(PAGE) | $(READY)
	$(BIN)/discovery loop datasets/spring_bench/rig.toml --quiet --out build/spring_bench
	$(BIN)/python $< build/spring_bench/report.html $@

docs/images/way.svg: docs/trace_modules.py $(CODE) | $(READY)
	$(BIN)/python $< docs/ARCHITECTURE.md $@ >/dev/null

# The generator and its theme are installed beside the package when they are first needed.
SITE := $(VENV)/.docs-installed
$(SITE): docs/requirements.lock | $(READY)
	@echo "installing the generator of the documentation"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r $<
	@touch $@

docs-site: $(SITE) ## Build the documentation with its gallery; any warning fails (three minutes)
	$(BIN)/sphinx-build -q -W --keep-going -b html -d build/docs-site/doctrees docs build/docs-site/html
	@echo "open build/docs-site/html/index.html"

linkcheck: $(SITE) ## Follow every external link of the documentation (needs the network)
	$(BIN)/sphinx-build -q -b linkcheck -D sphinx_gallery_conf.plot_gallery=False -d build/linkcheck/doctrees docs build/linkcheck

lock: ## Pin the dependencies again (needs the network)
	$(PYTHON) -m venv --clear build/lock
	build/lock/bin/python -m pip install --quiet --disable-pip-version-check uv
	build/lock/bin/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --no-header --no-annotate \
		--group build --group test --group lint pyproject.toml -o requirements.lock
	build/lock/bin/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --no-header --no-annotate \
		--group bench -c requirements.lock pyproject.toml -o benchmarks/requirements.lock
	build/lock/bin/uv pip compile --quiet --universal --generate-hashes --python-version 3.11 --no-header --no-annotate \
		--group docs -c requirements.lock pyproject.toml -o docs/requirements.lock

clean: ## Remove results and caches; the virtual environment stays
	@find reports -mindepth 1 ! -name README.md -delete
	@rm -rf build docs/examples docs/reference .pytest_cache .mypy_cache .ruff_cache .hypothesis .import_linter_cache
	@find discovery datasets tests benchmarks docs -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean ## Remove the virtual environment too
	@rm -rf $(VENV)
