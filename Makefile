# The commands a newcomer needs. Each but `clean` sets the project up first when that is needed.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help setup build demo teach test soak bench mutants lint clean
.PHONY: ready-to-simulate ready-to-measure ready-for-tests ready-to-mutate ready-to-check
MAKEFLAGS += --no-print-directory

# Tests and launches start Python hundreds of times: what is compiled once must last, whatever the shell says.
unexport PYTHONDONTWRITEBYTECODE

# What a person says may hold quotes and dollars: it goes through the environment, unread by make and the shell.
unexport TASK SEED INSTRUCTION CHECKPOINT PACKAGE SAMPLE
demo: export DEMO_TASK = $(value TASK)
demo: export DEMO_SEED = $(value SEED)
demo: export DEMO_INSTRUCTION = $(value INSTRUCTION)
demo: export DEMO_CHECKPOINT = $(value CHECKPOINT)

teach: export TEACH_TASK = $(value TASK)

help:
	@echo "make setup   system libraries, .venv, ROS workspace; can be repeated and resumed  [EXTRAS= TORCH=cpu LOCKED=1]"
	@echo "make demo    the whole graph does a task in the simulator  [TASK= SEED= INSTRUCTION= CHECKPOINT=]"
	@echo "make teach   the simulator and the page on which you demonstrate, in your browser  [TASK=]"
	@echo "make test    all tests"
	@echo "make soak    tests that load the machine for minutes"
	@echo "make bench   timings, to the screen and to out/bench.json"
	@echo "make mutants PACKAGE=...  what share of small bugs a package's tests notice  [SAMPLE= SEED=]"
	@echo "make lint    ruff, mypy, and TypeScript's checks of the page"
	@echo "make build   the ROS workspace only"
	@echo "make clean   remove what was built and written; .venv stays"
	@echo "source env.sh gives a shell with this project's python, packages and ros2"

setup:
	@tools/setup

ready-to-simulate:
	@tools/setup --when-needed --needs=simulate

ready-to-measure:
	@tools/setup --when-needed --needs="train simulate"

ready-for-tests:
	@tools/setup --when-needed --tests

ready-to-mutate:
	@tools/setup --when-needed --needs="train simulate develop"

ready-to-check:
	@tools/setup --when-needed --needs=develop

build:
	@tools/build

demo: ready-to-simulate
	@. ./env.sh && exec python -m cliport_benchmark.demo $${DEMO_TASK:+--task "$$DEMO_TASK"} $${DEMO_SEED:+--seed "$$DEMO_SEED"} \
		$${DEMO_INSTRUCTION:+--instruction "$$DEMO_INSTRUCTION"} $${DEMO_CHECKPOINT:+--checkpoint "$$DEMO_CHECKPOINT"}

teach: ready-to-simulate
	@. ./env.sh && exec ros2 launch cliport_bringup teach.launch.yaml $${TEACH_TASK:+"task:=$$TEACH_TASK"}

test: ready-for-tests
	@. ./env.sh && OMP_NUM_THREADS=1 exec python -m pytest -n 3 --no-loadscope-reorder $(PYTEST_ARGS)

soak: ready-for-tests
	@. ./env.sh && exec python -m pytest -m soak $(PYTEST_ARGS)

bench: ready-to-measure
	@. ./env.sh && exec python -m cliport_benchmark.bench

mutants: export MUTANTS_PACKAGE = $(value PACKAGE)
mutants: export MUTANTS_SAMPLE = $(value SAMPLE)
mutants: export MUTANTS_SEED = $(value SEED)
mutants: ready-to-mutate
	@. ./env.sh && exec nice -n 10 python tools/mutants.py "$$MUTANTS_PACKAGE" \
		$${MUTANTS_SAMPLE:+--sample "$$MUTANTS_SAMPLE"} $${MUTANTS_SEED:+--seed "$$MUTANTS_SEED"}

lint: ready-to-check
	@. ./env.sh && ruff check && ruff format --check && mypy && tools/check_page

clean:
	rm -rf build install log out .setup/build .pytest_cache .mypy_cache .ruff_cache
