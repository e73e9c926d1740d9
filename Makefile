# Fretwear: `make` shows what there is. Every target does its own set-up.
#
# Every path is relative to this directory, where make runs, so that it may lie anywhere.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
.PHONY: help deps build configured program debug run test lint keys docs clean
.PHONY: fuzz notebooks wheel ways sensitivities resonances modes calibration stops controls
.PHONY: parameters family
.PHONY: bench bench-precision bench-solvers bench-paper bench-time bench-scaling bench-limit
.PHONY: bench-peers bench-full compare cylinder damper good-for disk mistuned-disk paper
.PHONY: measured higher-modes pictures
.PHONY: thresholds
.PHONY: stress long faults sectors peaks bifurcations rest scars slow verify

BUILD := build/release
RUN := build/run
PYTHON := build/venv/bin/python
EXAMPLE := example/blade_sector
# Two targets may want the same environment; ninja runs the compilers side by side.
.NOTPARALLEL:
# Options for CMake, such as CMAKE_OPTIONS=-DCMAKE_PREFIX_PATH=/some/where
CMAKE_OPTIONS ?=
# system, scipy (the OpenBLAS of the Python package scipy-openblas32), or auto: the faster one
BLAS ?= system
export BLAS

help: ## this list
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 24

deps: build/deps.stamp ## install what is missing (system packages, build/venv)

# The stamp depends on the list of what is needed and on nothing else: a second call costs nothing.
build/deps.stamp: tools/deps.sh
	@mkdir -p build
	@tools/deps.sh build/venv
	@touch $@

# Building, running and drawing take three of the many Python packages.
build/run.stamp: tools/deps.sh
	@mkdir -p build
	@if [ ! -f build/deps.stamp ]; then tools/deps.sh build/venv run; fi
	@touch $@

build: build/deps.stamp configured ## optimised program build/release/fw_run
	@cmake --build $(BUILD) --target fw_run fretwear_python fretwear_shared

configured: build/run.stamp
	@if ! grep -qs FRETWEAR_PYTHON:BOOL=ON $(BUILD)/CMakeCache.txt || \
	   ! grep -qs FRETWEAR_BLAS:STRING=$(BLAS)$$ $(BUILD)/CMakeCache.txt || \
	   [ ! -f $(BUILD)/build.ninja ] || [ -n "$(CMAKE_OPTIONS)" ]; then \
	   if [ -f build/deps.stamp ]; then tools/deps.sh build/venv; else \
	      tools/deps.sh build/venv run; fi; \
	   cmake -S . -B $(BUILD) -G Ninja -DFRETWEAR_NATIVE=ON -DFRETWEAR_PYTHON=ON \
	      "-DPython3_EXECUTABLE=$(CURDIR)/$(PYTHON)" -DFRETWEAR_BLAS=$(BLAS) $(CMAKE_OPTIONS); \
	fi

debug: build/deps.stamp ## build/debug: every check, and floating-point traps
	@cmake -S . -B build/debug -G Ninja -DCMAKE_BUILD_TYPE=Debug $(CMAKE_OPTIONS)
	@cmake --build build/debug

run: $(RUN)/frf.png ## response of the blade sector with its picture, in build/run
	@echo "results: $(RUN)/frf.h5, $(RUN)/frf_stuck.h5, $(RUN)/frf.png"

# `program` always runs, and changes fw_run only where a source has changed; the recipe of fw_run is
# empty so that make looks at its time again afterwards.
program: configured
	@cmake --build $(BUILD) --target fw_run

$(BUILD)/fw_run: program ;

$(RUN)/frf.h5: $(EXAMPLE)/frf.nml $(wildcard $(EXAMPLE)/*.h5) $(BUILD)/fw_run
	@mkdir -p $(RUN)
	$(BUILD)/fw_run -o $@ $<

$(RUN)/frf_stuck.h5: $(EXAMPLE)/frf_stuck.nml $(wildcard $(EXAMPLE)/*.h5) $(BUILD)/fw_run
	@mkdir -p $(RUN)
	$(BUILD)/fw_run -o $@ $<

$(RUN)/frf.png: $(RUN)/frf.h5 $(RUN)/frf_stuck.h5 $(wildcard python/fretwear/*.py python/fretwear/plot/*.py)
	PYTHONPATH=python MPLBACKEND=Agg $(PYTHON) -m fretwear plot $(RUN)/frf.h5 \
	   --kind response --linear $(RUN)/frf_stuck.h5 -o $@

# The closing line has to be the last one, whatever the build said before.
test: build ## every test; the last line counts the cases
	@cmake --build $(BUILD)
	@$(PYTHON) test/support/run_tests.py --build $(BUILD) --python $(PYTHON)

lint: build/deps.stamp ## linters of the Fortran and the Python code, type checker
	@$(PYTHON) -m fortitude check --quiet
	@$(PYTHON) tools/comment_share.py
	@$(PYTHON) -m mypy
	@$(PYTHON) -m ruff check python conftest.py bench tools docs \
	   test/builds test/cyclic test/design test/families test/fretting test/legacy test/modes test/rest test/rigid \
	   test/robustness test/stress test/verify

keys: build ## tables of keys in the user guide, settings of the Python package
	@$(PYTHON) tools/write_keys.py $(BUILD)/fw_run

docs: build/deps.stamp ## documents as a site, references of library and package: build/docs
	@$(PYTHON) tools/build_docs.py build/docs

pictures: build/deps.stamp ## all pictures of the documents on one sheet: build/pictures.png
	@$(PYTHON) tools/contact_sheet.py

notebooks: build ## run docs/notebooks and keep what they show
	@PYTHONPATH=python:$(BUILD)/python $(PYTHON) tools/run_notebooks.py

wheel: build/deps.stamp ## a wheel that needs no compiler and no library, tried: build/wheel
	@tools/build_wheel.sh build/wheel $(PYTHON)

ways: build/deps.stamp ## the other ways to build: CMake alone, fpm, pip
	@tools/check_builds.sh build/ways $(PYTHON)

# Adds up the counts of docs/robustness.md once they are there, whatever they say.
OVERVIEW := trap '$(PYTHON) test/robustness/overview.py' EXIT;

thresholds: build ## limits of heuristics halved and doubled, and what random families notice
	PYTHONPATH=python:$(BUILD)/python $(PYTHON) test/robustness/thresholds.py -o

# Goes on where it was stopped; a changed program starts anew.
stress: build ## every case to its extremes, written to docs/robustness.md
	$(OVERVIEW) $(PYTHON) test/stress/stress.py --state build/stress -o docs/robustness.md

long: build ## memory and time of long runs, written to docs/robustness.md
	$(OVERVIEW) $(PYTHON) test/stress/long_runs.py -o docs/robustness.md

verify: build ## tests in PARTS (all) of the builds in docs/robustness.md
	$(PYTHON) test/verify/verify.py --python $(PYTHON) $(PARTS)

bench: build ## times of points and sweeps, written to docs/benchmarks.md
	PYTHONPATH=python $(PYTHON) -m bench.run speed

bench-precision: build ## error against run time of every method, and of wear
	PYTHONPATH=python $(PYTHON) -m bench.run precision events

bench-solvers: build ## every solver, flow and scheme from many starts
	PYTHONPATH=python $(PYTHON) -m bench.run solvers

bench-paper: build ## methods, iterations against frequency, aliasing
	PYTHONPATH=python $(PYTHON) -m bench.run paper iterations aliasing

bench-time: build ## harmonic balance against integration in time
	PYTHONPATH=python $(PYTHON) -m bench.run time joints

# Models that are not there yet are generated into build/bench first; 768 pairs take minutes.
# 1,536 pairs are measured too where build/bench/sector_1536_coarse.h5 was made (half an hour).
bench-scaling: build ## time and memory of a frequency, 16 to 768 pairs, beside BEFORE=fw_run
	PYTHONPATH=python $(PYTHON) -m bench.run scaling $(if $(BEFORE),--before $(BEFORE))

bench-limit: build ## where the time goes against its floor, and what is skipped
	PYTHONPATH=python:$(BUILD)/python $(PYTHON) -m bench.run limit skips laws

# Another environment's Python where pyharm-os is installed: make bench-peers PEER_PYTHON=...
PEER_PYTHON ?= $(PYTHON)
# Branches of NLvib's examples too, beside BEFORE=fw_run; NLVIB=FOLDER counts its points (Octave).
bench-peers: build ## pyHarm on the same problems, where it is installed, and NLvib's branches
	PYTHONPATH=python $(PYTHON) -m bench.run peers --peer-python $(PEER_PYTHON) \
	   $(if $(BEFORE),--before $(BEFORE)) $(if $(NLVIB),--nlvib $(NLVIB))

bench-full: build ## every part of docs/benchmarks.md
	PYTHONPATH=python:$(BUILD)/python $(PYTHON) -m bench.run all --peer-python $(PEER_PYTHON)

# make compare OTHER=/path/to/fw_run TIMES=9
TIMES ?= 0
compare: build ## numbers and work of OTHER (another fw_run) and of this build, TIMES paired runs
	@PYTHONPATH=python $(PYTHON) -m bench.compare.compare_builds --of $(BUILD)/fw_run \
	   --with $(OTHER) --times $(TIMES)

paper: build ## figures and tables of the paper on the sector, in docs/paper
	PYTHONPATH=python $(PYTHON) -m bench.paper.gallery

damper: build ## tables and picture of docs/damper.md
	PYTHONPATH=python:$(BUILD)/python MPLBACKEND=Agg $(PYTHON) -m bench.dampers --build $(BUILD)

cylinder: build ## tables and pictures of docs/cylinder_on_flat.md; PARTS="large thousand": fine grids
	PYTHONPATH=python:$(BUILD)/python MPLBACKEND=Agg $(PYTHON) -m bench.cylinder --build $(BUILD) \
	   $(PARTS)

good-for: build ## what uncertain inputs do to a peak, in docs/good_for.md
	PYTHONPATH=python:$(BUILD)/python $(PYTHON) -m bench.good_for --build $(BUILD)

disk: build ## tables and pictures of docs/shrouded_disk.md
	PYTHONPATH=python:$(BUILD)/python MPLBACKEND=Agg $(PYTHON) -m bench.disk --build $(BUILD)

mistuned-disk: build ## figures and pictures of docs/mistuned_disk.md
	PYTHONPATH=python:$(BUILD)/python MPLBACKEND=Agg $(PYTHON) -m bench.disk.mistuned
	PYTHONPATH=python:$(BUILD)/python MPLBACKEND=Agg $(PYTHON) -m bench.disk.amplification

DATA ?=
BEAM := PYTHONPATH=python:$(BUILD)/python MPLBACKEND=Agg $(PYTHON) example/brake_reuss

measured: build ## the measured beam in docs/brake_reuss.md; DATA=ForcedFrequencyResponses.mat
	$(BEAM)/brake_reuss.py $(DATA) --folder $(BUILD)/brake_reuss --document docs/brake_reuss.md
	cp $(BUILD)/brake_reuss/brake_reuss.png docs/images/brake_reuss.png
	$(BEAM)/attempts.py $(DATA) --document docs/brake_reuss.md

higher-modes: build ## prediction of the higher modes of that beam, in docs/brake_reuss.md
	$(BEAM)/higher_modes.py --document docs/brake_reuss.md

BEFORE ?=
rest: build ## where pairs of the velocity law come to rest, also of a program BEFORE
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/rest/shakedown.py \
	   $(if $(BEFORE),--before $(BEFORE)) -o docs/robustness.md

slow: build ## slow stick-slip, also of a program BEFORE, written to docs/robustness.md
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/rigid/slow_family.py \
	   $(if $(BEFORE),--before $(BEFORE)) -o docs/robustness.md

calibration: build ## parameters of 100 noisy measurements found again, in docs/design.md
	PYTHONPATH=python:$(BUILD)/python $(PYTHON) test/design/calibration_trials.py \
	   -o docs/design.md

sensitivities: build ## derivatives of 200 random cases against differences, in docs/robustness.md
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/oracles/sensitivity_family.py -o docs/robustness.md

resonances: build ## 200 random resonances over a parameter against sweeps, in docs/robustness.md
	PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/resonance/resonance_family.py \
	   -o docs/robustness.md

controls: build ## 200 random responses of given amplitude against equations of another code
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/oracles/control_family.py -o docs/robustness.md

family: build ## a random family of test/families at full size: NAME=, BEFORE=fw_run
	PYTHONPATH=python:$(BUILD)/python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/families/runner.py \
	   $(NAME) --page $(if $(BEFORE),--before $(BEFORE))

parameters: build ## 112 random sweeps over matrices against equations of another code, and runs
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/oracles/parameter_family.py -o docs/robustness.md

modes: build ## 200 random nonlinear modes against whole structures, in docs/robustness.md
	PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/modes/mode_family.py \
	   -o docs/robustness.md

scars: build ## steady states of wear against a march of cycles, also of a program BEFORE
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/fretting/steady_states.py \
	   $(if $(BEFORE),--before $(BEFORE)) -o docs/robustness.md

peaks: build ## reported peaks of random sweeps, also of a program BEFORE, written to docs/robustness.md
	PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/robustness/peaks.py \
	   $(if $(BEFORE),--before $(BEFORE)) --state build/peaks.jsonl -o docs/robustness.md

bifurcations: build ## bifurcations of 200 random branches against shooting, in docs/robustness.md
	PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/bifurcations/bifurcations.py -o

# Goes on where it was stopped; a changed program starts anew.
sectors: build ## 300 random sectors against whole annuli, 45 mistuned ones, in docs/robustness.md
	@if [ $(BUILD)/fw_run -nt build/sectors.jsonl ]; then rm -f build/sectors.jsonl; fi
	@if [ $(BUILD)/fw_run -nt build/mistuned.jsonl ]; then rm -f build/mistuned.jsonl; fi
	PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/cyclic/family.py --count 300 \
	   --state build/sectors.jsonl -o docs/robustness.md
	PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/cyclic/mistuned_family.py --count 45 \
	   --state build/mistuned.jsonl -o docs/robustness.md

stops: build ## how long a stop takes at 16, 48 and 384 pairs, written to docs/robustness.md
	FW_RUN=$(BUILD)/fw_run $(PYTHON) test/robustness/stops.py -o docs/robustness.md

faults: build ## kills, signals, full disks, two runs at a time, written to docs/robustness.md
	$(OVERVIEW) PYTHONPATH=python FW_RUN=$(BUILD)/fw_run $(PYTHON) test/robustness/fault_report.py \
	   -o docs/robustness.md

# Goes on where it was stopped; a changed program starts anew.
N ?= 100000
FUZZ := build/fuzz
fuzz: build ## N hostile inputs (100000), written to docs/robustness/inputs.md
	@mkdir -p $(FUZZ)
	@if [ $(BUILD)/fw_run -nt $(FUZZ)/fuzz.json ]; then \
	   rm -f $(FUZZ)/fuzz.json $(FUZZ)/results/fuzz.json; fi
	OMP_NUM_THREADS=1 $(PYTHON) test/robustness/fuzz.py --build $(BUILD) -n $(N) --jobs 2 \
	   --state $(FUZZ)
	OMP_NUM_THREADS=1 $(PYTHON) test/robustness/fuzz.py --build $(BUILD) -n $$(($(N)/50)) --jobs 2 \
	   --state $(FUZZ)/results --family "damaged result file"
	OMP_NUM_THREADS=1 PYTHONPATH=python:$(BUILD)/python $(PYTHON) test/robustness/fuzz_python.py \
	   -n $$(($(N)/5)) --report $(FUZZ)/python.json
	$(OVERVIEW) $(PYTHON) test/robustness/fuzz_report.py $(FUZZ)

clean: ## remove everything built but the Python environment
	rm -rf $(BUILD) build/debug build/docs build/wheel build/ways build/verify build/stress \
	   build/bench build/gfortran_* build/cache.toml build/compile_commands.json \
	   $(RUN) $(FUZZ)
