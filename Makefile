# The commands a newcomer needs. Each but `clean` sets the project up first when that is needed.

SHELL := /bin/bash
.DEFAULT_GOAL := help
.PHONY: help setup ready ready-for-tests build demo test soak bench mutants lint clean
MAKEFLAGS += --no-print-directory

# What a person says may hold quotes and dollars: it goes through the environment, unread by make and the shell.
unexport TASK SEED INSTRUCTION CHECKPOINT PACKAGE SAMPLE
demo: export DEMO_TASK = $(value TASK)
demo: export DEMO_SEED = $(value SEED)
demo: export DEMO_INSTRUCTION = $(value INSTRUCTION)
demo: export DEMO_CHECKPOINT = $(value CHECKPOINT)

help:
	@echo "make setup   system libraries, .venv, ROS workspace; can be repeated and resumed"
	@echo "make demo    the whole graph does a task in the simulator  [TASK= SEED= INSTRUCTION= CHECKPOINT=]"
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

ready:
	@tools/setup --when-needed

ready-for-tests:
	@tools/setup --when-needed --tests

build:
	@tools/build

demo: ready
	@. ./env.sh && exec python -m cliport_benchmark.demo $${DEMO_TASK:+--task "$$DEMO_TASK"} $${DEMO_SEED:+--seed "$$DEMO_SEED"} \
		$${DEMO_INSTRUCTION:+--instruction "$$DEMO_INSTRUCTION"} $${DEMO_CHECKPOINT:+--checkpoint "$$DEMO_CHECKPOINT"}

test: ready-for-tests
	@. ./env.sh && exec python -m pytest -n 2 --dist loadgroup --no-loadscope-reorder $(PYTEST_ARGS)

soak: ready-for-tests
	@. ./env.sh && exec python -m pytest -m soak $(PYTEST_ARGS)

bench: ready
	@. ./env.sh && exec python -m cliport_benchmark.bench

mutants: export MUTANTS_PACKAGE = $(value PACKAGE)
mutants: export MUTANTS_SAMPLE = $(value SAMPLE)
mutants: export MUTANTS_SEED = $(value SEED)
mutants: ready
	@. ./env.sh && exec nice -n 10 python tools/mutants.py "$$MUTANTS_PACKAGE" \
		$${MUTANTS_SAMPLE:+--sample "$$MUTANTS_SAMPLE"} $${MUTANTS_SEED:+--seed "$$MUTANTS_SEED"}

lint: ready
	@. ./env.sh && ruff check && ruff format --check && mypy && tools/check_page

clean:
	rm -rf build install log out .setup/build .pytest_cache .mypy_cache .ruff_cache
