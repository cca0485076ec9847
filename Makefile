# Three commands matter: `make run`, `make check` while working, `make test` before handing in. All of them make the
# environment first; see setup.sh.
# The other targets are parts of them, for daily work.

VENV := .venv
BIN := $(VENV)/bin
SAMPLE := assets/sample
SETUP_FLAGS :=
WORKERS := 2
# Files as a whole, so that what a file builds for its tests is built once; in the order of tests/conftest.py.
PYTEST := $(BIN)/python -m pytest --numprocesses=$(WORKERS) --dist=loadfile --no-loadscope-reorder
# Children of tests would compile every module again.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup run check test coverage lint types fmt bench faults figures soak docs screenshots golden clean

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## /  make \1	/p' Makefile | expand -t 16

setup: ## make .venv from requirements.lock, add missing system libraries
	@./setup.sh $(SETUP_FLAGS)

run: setup ## start on the sample capture: the window, or the same job headless where there is no display
	@$(BIN)/clipgstream $(SAMPLE)

check: setup lint ## linters, types, import contracts and the fast tests
	@$(BIN)/pyright --pythonpath $(BIN)/python & types=$$!; \
	$(PYTEST) --quiet -m "not slow and not e2e"; tests=$$?; \
	wait $$types && exit $$tests

test: SETUP_FLAGS := --tests
test: setup lint types ## everything CI runs: linters, types, import contracts, all tests
	@$(BIN)/python -m tests.count_lines
	@$(PYTEST) --durations=15

coverage: setup ## branches of engine and app that tests take; compiled kernels and child processes are not seen
	@$(PYTEST) --quiet --cov=engine --cov=app --cov-branch --cov-report=term:skip-covered --cov-report=html:out/coverage

lint: setup ## ruff (rules and format) and the import contracts
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/lint-imports

types: setup ## pyright
	@$(BIN)/pyright --pythonpath $(BIN)/python

fmt: setup ## format and apply the safe fixes
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

bench: setup ## measure the figures of the README, print them as tables, draw out/speed_error.png
	@$(BIN)/python -m tests.benchmarks.bench_quality $(SAMPLE)
	@$(BIN)/clipgstream bench --full --capture $(SAMPLE) --out out
	@$(BIN)/python -m tests.benchmarks.bench_window $(SAMPLE)
	@$(BIN)/python -m tests.benchmarks.bench_mending out/mending
	@$(BIN)/python -m tests.benchmarks.bench_selecting $(SAMPLE)

faults: setup ## damage files and captures, contend for locks, kill trainings and editing, fill disks: the figures of the README
	@for script in $$(grep -l "^if __name__" tests/faults/*.py); do \
		$(BIN)/python -m $$(echo $${script%.py} | tr / .) || exit 1; \
	done

soak: setup ## one hour of use by a program: does the window hold more and more memory or handles? MINUTES=60
	@$(BIN)/python -m tests.soak.soak --minutes $(or $(MINUTES),60) $(if $(PROJECT),--project "$(PROJECT)")

figures: setup ## measure the short tables of docs/results again, all with LONG=1 BASKETBALL=folder, and fill the documents
	@rm -rf out/figures
	@$(BIN)/python -m tests.benchmarks.figures out/figures $(if $(LONG),--all,--short) \
		$(if $(BASKETBALL),--basketball "$(BASKETBALL)")
	@$(BIN)/python -m tests.documents write

docs: setup ## fill the generated parts of the documents: keys, commands, settings
	@$(BIN)/python -m tests.documents write

screenshots: setup ## pictures of the window for the documents, of PROJECT=folder or of a quick one made from the sample
	@$(BIN)/python -m tests.screenshots $(if $(PROJECT),--project "$(PROJECT)")

golden: setup ## draw the golden pictures anew; look at each before committing it
	@$(BIN)/python -m pytest tests --update-golden -k golden

clean: ## remove the environment, caches and outputs
	rm -rf $(VENV) out *.egg-info .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find app engine ui tests -name __pycache__ -type d -prune -exec rm -rf {} +
