# SPDX-License-Identifier: GPL-3.0-or-later
# Matterfit: everything a person does with this tree. `make` alone says what there is.
# Works from any current directory (make -C PATH …); writes only below build/.

# make's own functions split a path at its spaces, so the tree is the current directory, quoted for
# the shell.
ifneq ($(patsubst ./%,%,$(lastword $(MAKEFILE_LIST))),Makefile)
$(error Run it in the tree, or as: make -C TREE TARGET)
endif
ROOT := '$(subst ','\'',$(CURDIR))'
RUN := bash $(ROOT)/scripts/in_tree.sh
PYTHON := $(RUN) python
.DEFAULT_GOAL := help
SET := small
.PHONY: help demo test build bench estimates random-solids five-materials other-simulators finite-elements ball-drops blind blind-small blind-set format lint fuzz run package clean

help: ## Say what each target does (the default)
	@grep -hE '^[a-z-]+:.*## ' $(ROOT)/Makefile | sed -E 's/:.*## /\t/' | \
	  while IFS="$$(printf '\t')" read -r name text; do printf '  make %-14s %s\n' "$$name" "$$text"; done

demo: ## The main job on the sample under `blender -b`: capture, fit, diagnose, extend, compare, throw, rerun, bake, render
	@bash $(ROOT)/scripts/dependencies.sh demo
	@$(RUN) bash $(ROOT)/scripts/build.sh
	@$(RUN) bash $(ROOT)/scripts/demo.sh

test: ## Every test; ends with `N passed, N failed, N skipped` (ONLY="native blender" runs some parts; LONG=1 all of them)
	@bash $(ROOT)/scripts/dependencies.sh test
	@LONG=$(LONG) $(PYTHON) $(ROOT)/scripts/test.py $(ONLY)

build: ## build/bin/matterfit and build/lib/libmatterfit.so, optimised
	@bash $(ROOT)/scripts/dependencies.sh build
	@$(RUN) bash $(ROOT)/scripts/build.sh

bench: ## Speed of the solver, one JSON object a line (NEURAL=1: of the neural laws; OTHERS=1: Taichi and Genesis, or PyTorch, beside it, by pip)
	@bash $(ROOT)/scripts/dependencies.sh build 1>&2
	@$(PYTHON) $(ROOT)/scripts/bench.py $(if $(NEURAL),--neural) $(if $(OTHERS),--others)

estimates: ## What Estimate says of some runs beside the time that they take, some minutes (THREADS, REPEAT, ONLY="water dam")
	@bash $(ROOT)/scripts/dependencies.sh build 1>&2
	@$(RUN) bash $(ROOT)/scripts/build.sh 1>&2
	@$(PYTHON) $(ROOT)/scripts/estimates.py $(if $(THREADS),--threads $(THREADS)) $(if $(REPEAT),--repeat $(REPEAT)) $(if $(ONLY),--only $(ONLY))

random-solids: ## Throw 200 random elastic bodies at random and say which ran (COUNT, SEED, MESH=file.ply for one mesh)
	@bash $(ROOT)/scripts/dependencies.sh build 1>&2
	@$(RUN) bash $(ROOT)/scripts/build.sh random_solids_bench 1>&2
	@$(RUN) $(ROOT)/build/release/bin/random_solids_bench --seed $(or $(SEED),1) --count $(or $(COUNT),200) $(if $(MESH),--mesh $(MESH))

five-materials: ## Fit 45 clips of another simulator and score the fits, hours (ONLY="sand elastic_box" fits some)
	@bash $(ROOT)/scripts/dependencies.sh fits 1>&2
	@$(PYTHON) $(ROOT)/scripts/five_materials.py $(if $(ONLY),--only $(ONLY)) $(if $(THREADS),--threads $(THREADS))

other-simulators: ## Fit the clips of other simulators in FOLDER (../shared/data/other_simulators), a quarter of an hour each
	@bash $(ROOT)/scripts/dependencies.sh fits 1>&2
	@$(PYTHON) $(ROOT)/scripts/other_simulators.py $(FOLDER) $(if $(ONLY),--only $(ONLY)) $(if $(THREADS),--threads $(THREADS))

finite-elements: ## Make clips of elastic bodies by finite elements and fit them, a quarter of an hour
	@bash $(ROOT)/scripts/dependencies.sh fits 1>&2
	@$(PYTHON) $(ROOT)/scripts/finite_elements.py $(if $(ONLY),--only $(ONLY))
	@$(PYTHON) $(ROOT)/scripts/other_simulators.py $(ROOT)/build/finite_elements $(if $(ONLY),--only $(ONLY)) $(if $(THREADS),--threads $(THREADS))

ball-drops: ## Diagnose real balls dropped from a bridge, in FOLDER (../shared/data/balls); ONLY="golf_ball_1", HOLD_OUT="…"
	@bash $(ROOT)/scripts/dependencies.sh fits 1>&2
	@$(RUN) bash $(ROOT)/scripts/build.sh
	@$(PYTHON) $(ROOT)/scripts/ball_drops.py $(FOLDER) $(if $(ONLY),--only $(ONLY)) $(if $(HOLD_OUT),--hold-out $(HOLD_OUT)) $(if $(REPORT),--report $(REPORT))

blind: ## Hide effects in 400 recordings, diagnose them without the labels, score: some ten hours by estimate (CASES, SEED, JOBS)
	@$(MAKE) --no-print-directory -C $(ROOT) blind-set SET=full

blind-small: ## The same with a fixed two dozen small cases: by estimate half an hour on two quiet cores
	@$(MAKE) --no-print-directory -C $(ROOT) blind-set SET=small

blind-set:
	@bash $(ROOT)/scripts/dependencies.sh fits 1>&2
	@$(RUN) bash $(ROOT)/scripts/build.sh
	@$(PYTHON) $(ROOT)/scripts/blind_hide.py $(SET) $(if $(SEED),--seed $(SEED)) $(if $(CASES),--cases $(CASES)) $(if $(ONLY),--only $(ONLY))
	@$(PYTHON) $(ROOT)/scripts/blind_find.py $(SET) $(if $(JOBS),--jobs $(JOBS) --threads 1) $(if $(ONLY),--only $(ONLY))
	@$(PYTHON) $(ROOT)/scripts/blind_open.py $(SET) --throws

format: ## Bring C++ and Python into the tree's form
	@bash $(ROOT)/scripts/dependencies.sh test
	@$(PYTHON) $(ROOT)/scripts/lint.py --fix

lint: ## Form, ruff and clang-tidy (changed files; ALL=1 for the whole tree)
	@bash $(ROOT)/scripts/dependencies.sh test
	@$(PYTHON) $(ROOT)/scripts/lint.py $(if $(ALL),--all)

fuzz: ## A minute of libFuzzer with sanitizers for each parser (SECONDS_EACH=600 for more)
	@bash $(ROOT)/scripts/dependencies.sh test
	@$(PYTHON) $(ROOT)/scripts/fuzz.py --seconds $(or $(SECONDS_EACH),60)

run: ## Open Blender with the add-on switched on
	@bash $(ROOT)/scripts/dependencies.sh demo
	@$(RUN) bash $(ROOT)/scripts/build.sh
	@$(RUN) bash $(ROOT)/scripts/blender.sh

package: ## build/matterfit-VERSION.zip: installs in Blender 3.4 to 5.x, native library inside
	@bash $(ROOT)/scripts/dependencies.sh package
	@$(RUN) bash $(ROOT)/scripts/build.sh
	@$(PYTHON) $(ROOT)/scripts/package.py

clean: ## Remove build/ (compiled files, downloaded test environments, results of the demo)
	rm -rf $(ROOT)/build
