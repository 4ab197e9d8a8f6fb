# Everything runs in one environment, $(VENV), that these targets make; nothing else on the machine changes.
PYTHON ?= $(shell python3.11 -c 'import sys; print(sys.executable)' 2>/dev/null || echo python3)
VENV ?= .venv
LOWEST := $(VENV)-lowest
RUNS ?= runs
FIGURES ?= figures
REPORT ?= report
FUZZ_SECONDS ?= 600
TEST_SECONDS ?= 600
TEST_WORKERS ?= 2
MEASURED := build/verification
CORE := first_edition.py save.py yaml_reader.py robot_model.py reduced_dynamics.py ik.py bag_reader.py bag_writer.py \
        export.py cli_figures.py 'compiled_dynamics.py::test_a_step_is_that_of_pinocchio[shipped-rk4]'
CONDITIONS := $(addprefix test/core/test_,joint_effects.py wrenches.py panels.py sensors.py conditions.py)
SITE := build/docs/html

BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint .ci/constraints.txt
OPTIMA = OPENBLAS_NUM_THREADS=1 $(VENV)-crocoddyl/bin/python -m pytest -q -p no:cacheprovider test/verification/test_crocoddyl.py
MEASURE = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest test/verification $(CONDITIONS) --evidence $(MEASURED)/evidence.json

# The environment stands alone: what a sourced ROS workspace or another environment exports must not leak in.
unexport PYTHONPATH PYTHONHOME AMENT_PREFIX_PATH CMAKE_PREFIX_PATH LD_LIBRARY_PATH _ROS_WHEELS_BOOTSTRAP_COMPLETE

.DEFAULT_GOAL := help
.PHONY: help handover figures report simulate test verify measure bench docs acceptance screenshots faults lowest cycles fuzz hostile soak reference clearance geometries crocoddyl masses effects scenarios engines evidence campaign balancer lint install colcon clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-11s %s\n", $$1, $$2}' $(firstword $(MAKEFILE_LIST))

handover: install  ## hand the deputy over under NMPC, then PID, over DDS in lock step; record both; compare
	$(BIN)/sms-handover run paper --controller nmpc --output $(RUNS)/nmpc --overwrite
	$(BIN)/sms-handover run paper --controller pid --output $(RUNS)/pid --overwrite
	$(BIN)/sms-handover compare $(RUNS)/nmpc $(RUNS)/pid

figures: install  ## draw the paper's figures from the runs of `make handover`
	$(BIN)/sms-handover report $(RUNS)/nmpc $(RUNS)/pid --figures $(FIGURES) --format pdf,png,svg

report: install  ## write an HTML page on the runs of `make handover`
	$(BIN)/sms-handover report $(RUNS)/nmpc $(RUNS)/pid --output $(REPORT) --overwrite

simulate: install  ## the same handover in one process, without DDS or a recording
	$(BIN)/sms-handover simulate

test: lint  ## check style and types, then run every test but those of verify in TEST_WORKERS processes
	$(BIN)/python -m pytest --numprocesses $(TEST_WORKERS) --dist loadfile --timeout $(TEST_SECONDS) --durations 20

verify: $(VENV)/.verify $(VENV)-crocoddyl/.crocoddyl  ## measure against independent answers, break every law on purpose, write docs/verification.md
	@mkdir -p $(MEASURED)
	status=0; \
	$(MEASURE) || status=1; \
	$(OPTIMA) || status=1; \
	$(BIN)/python test/verification/mutations.py --output $(MEASURED)/breaks.json || status=1; \
	$(BIN)/python test/verification/report.py $(MEASURED)/evidence.json --breaks $(MEASURED)/breaks.json || status=1; \
	exit $$status

measure: $(VENV)/.verify  ## the measurements of verify alone: nothing is broken, no report is written
	@mkdir -p $(MEASURED)
	$(MEASURE)

bench: $(VENV)/.bench  ## measure how long things take, against other engines too; write docs/performance.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.performance

faults: $(VENV)/.test  ## inject every fault, check what is promised for it, write docs/reliability.md
	$(BIN)/python test/faults --write docs/reliability.md

docs: $(VENV)/.docs  ## build the documentation as a site, every warning an error, and look at it in a browser
	rm -rf build/docs docs/api
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -d build/docs/doctrees docs $(SITE)
	$(BIN)/python -m pytest test/site --site $(SITE)
	@echo "The site begins at $(SITE)/index.html"

lowest: $(LOWEST)/.lowest  ## test the core with the lowest versions of other packages that setup.py allows
	$(LOWEST)/bin/python -m pytest -p no:cacheprovider -W ignore::DeprecationWarning $(addprefix test/core/test_,$(CORE))

cycles: $(VENV)/.test  ## start and stop the graph 100 times: no orphan, nothing left in shared memory, no growth
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.cycles

fuzz: $(VENV)/.test  ## feed broken inputs to every reader for FUZZ_SECONDS each, write docs/fuzzing.md
	$(BIN)/python test/fuzz --seconds $(FUZZ_SECONDS) --write docs/fuzzing.md

hostile: $(VENV)/.test  ## run every command with bad inputs, environments and streams, 500 times
	$(BIN)/python test/hostile --count 500

soak: $(VENV)/.test  ## run 30 minutes of simulated time, watch every process, write docs/soak.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.soak --write

screenshots: docs report  ## take the pictures of docs/images again: this site, and report and 3D view of `make handover`
	$(BIN)/python test/browser/screenshots.py $(REPORT)/index.html $(SITE) $(RUNS)/nmpc

clearance: install  ## simulate the shipped handover under each law and write docs/clearance.md
	$(BIN)/python -m docs.clearance

geometries: install  ## try random possible geometries of the handover under both laws, write docs/geometries.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m docs.geometries

evidence: $(VENV)/.test  ## run the campaign of the control laws, about half an hour, and write docs/laws.md
	$(BIN)/python -m docs.evidence

campaign: $(VENV)/.test  ## compare 1000 runs of a campaign bit for bit, however they are run or killed, write docs/campaigns.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m benchmarks.campaign_equality

effects: install  ## run the smooth handover under each effect of conditions alone, write docs/conditions.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m docs.effects

acceptance: install  ## run every scenario, nominal seeds and shares of friction under laws with a model, write docs/control.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m docs.acceptance

balancer: $(VENV)/.test  ## measure base turn against tool error and clearance under examples/balancer, write docs/balancer.md
	rm -rf build/balancer
	$(PIP) --no-deps --target build/balancer ./examples/balancer
	rm -rf examples/balancer/build examples/balancer/*.egg-info
	PYTHONPATH=build/balancer OPENBLAS_NUM_THREADS=1 $(BIN)/python -m docs.balancer

masses: install  ## hand over deputies of 1 to 24 kg, known to the law or not, write docs/deputy_with_mass.md
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m docs.masses

scenarios: install  ## run every shipped scenario in one process and draw it again for docs/scenarios.md
	$(BIN)/python -m docs.scenario_pictures

engines: $(VENV)-basilisk/.engines  ## replay shipped scenarios (SCENARIOS, or all) in MuJoCo and Basilisk, write docs/second_engine.md
	OPENBLAS_NUM_THREADS=1 $(VENV)-basilisk/bin/python -m docs.second_engine $(SCENARIOS)
	OPENBLAS_NUM_THREADS=1 $(VENV)-basilisk/bin/python -m pytest -q -p no:cacheprovider test/verification/test_second_engine.py -k basilisk

crocoddyl: $(VENV)-crocoddyl/.crocoddyl  ## compare optimal plans of mpc without limits with those of Crocoddyl
	$(OPTIMA)

reference: install  ## write the pages of docs/ that list what is in the code
	$(BIN)/python -m docs.reference

lint: $(VENV)/.test  ## check style and types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

install: $(VENV)/.package  ## make the environment and install the package into it

colcon:  ## build the package as a ROS workspace does, with colcon, and list its executables
	PYTHON="$(PYTHON)" .ci/colcon

clean:  ## remove the environment and everything built; recordings stay
	rm -rf $(VENV) $(LOWEST) $(VENV)-basilisk $(VENV)-crocoddyl build dist docs/api *.egg-info interfaces*/build interfaces*/*.egg-info .mypy_cache .pytest_cache .ruff_cache

# Stamps: each holds until a file it depends on changes.
INTERFACES := $(wildcard interfaces/*.txt interfaces/*.cmake interfaces/*.xml interfaces/*.py interfaces/*.toml) \
              $(wildcard interfaces/msg/*.msg interfaces/srv/*.srv)
TF2 := $(wildcard interfaces_tf2/*.txt interfaces_tf2/*.xml interfaces_tf2/*.py interfaces_tf2/*.toml interfaces_tf2/msg/*.msg)
METADATA := setup.py setup.cfg pyproject.toml package.xml

$(VENV)/.environment:
	@command -v c++ >/dev/null || command -v g++ >/dev/null || command -v clang++ >/dev/null || \
	  { echo "sms_handover: no C++ compiler found: install one (Debian, Ubuntu: apt install g++), then run make again"; exit 1; } >&2
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(LOWEST)/.lowest: .ci/lowest.txt
	$(PYTHON) -m venv $(LOWEST)
	$(LOWEST)/bin/python -m pip install --quiet --disable-pip-version-check --requirement .ci/lowest.txt
	@touch $@

$(VENV)/.interfaces: $(VENV)/.environment $(INTERFACES) .ci/constraints.txt
	@echo "Building the interface package and installing the ROS wheels (about a minute)"
	$(PIP) ./interfaces
	@touch $@

# An environment of wheels has no tf2_msgs of ROS; where ROS is installed nobody comes here.
$(VENV)/.tf2: $(VENV)/.interfaces $(TF2)
	@echo "Building tf2_msgs, which no wheel carries (half a minute)"
	$(PIP) ./interfaces_tf2
	@touch $@

$(VENV)/.package: $(METADATA) | $(VENV)/.interfaces $(VENV)/.tf2
	$(PIP) --editable '.[analysis,ros]'
	@touch $@

$(VENV)/.test: $(VENV)/.package
	$(PIP) --editable '.[analysis,ros,test]'
	@touch $@

$(VENV)/.verify: $(VENV)/.test
	$(PIP) --editable '.[analysis,ros,test,verify]'
	@touch $@

$(VENV)-basilisk/.engines: $(METADATA) .ci/basilisk.txt
	$(PYTHON) -m venv $(VENV)-basilisk
	$(VENV)-basilisk/bin/python -m pip install --quiet --disable-pip-version-check --constraint .ci/basilisk.txt --editable '.[basilisk,mpc,mujoco]' 'pytest>=8.4'
	@touch $@

$(VENV)-crocoddyl/.crocoddyl: $(METADATA)
	$(PYTHON) -m venv $(VENV)-crocoddyl
	$(VENV)-crocoddyl/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[crocoddyl,mpc]' 'pytest>=8.4'
	@touch $@

$(VENV)/.docs: $(VENV)/.test
	$(PIP) --editable '.[analysis,ros,test,docs]'
	@touch $@

$(VENV)/.bench: $(VENV)/.verify
	$(PIP) --editable '.[analysis,ros,test,verify,bench]'
	@touch $@
