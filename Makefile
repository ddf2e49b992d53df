# Needs Python 3.11 or newer and make; every target sets up its own environment in .venv.
# PYTHON=/path/to/python chooses the interpreter, ARGS=... goes to the command behind the target.

BIN := .venv/bin
RUN := .venv/.ready-run
DEV := .venv/.ready-dev
ARGS ?=
export PYTHON

.DEFAULT_GOAL := help
.PHONY: help demo test prove check bench picture firmware clean

help: ## list what can be made
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "  make %-9s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

demo: $(RUN) ## identify, compensate, hide an effect and find it; leaves out/demo/report.html
	$(BIN)/rtcomp demo --out out/demo --force $(ARGS)

test: $(DEV) ## every quick test
	$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadfile $(ARGS)

prove: $(DEV) ## the proofs that take long; those that need a quiet machine one at a time
	@status=0; \
	$(BIN)/python -m pytest -m "slow and not realtime" -n 2 --dist loadfile $(ARGS) || [ $$? = 5 ] || status=1; \
	$(BIN)/python -m pytest -m "slow and realtime" $(ARGS) || [ $$? = 5 ] || status=1; \
	exit $$status

check: $(DEV) ## style, types, layers and every quick test
	$(BIN)/python tools/check.py $(ARGS)

bench: $(DEV) ## the benchmarks, one after the other
	@set -e; for file in tools/bench_*.py; do echo "== $$file"; $(BIN)/python "$$file" $(ARGS); done

picture: $(DEV) ## draw the pictures of README and pages anew
	$(BIN)/python tools/make_pictures.py $(ARGS)

firmware: ## the board's program in C, for this computer
	@$(MAKE) --no-print-directory -C drivers/firmware

clean: ## remove out/demo and what tools and compilers cached; .venv stays
	rm -rf out/demo build dist drivers/firmware/build .pytest_cache .mypy_cache .ruff_cache .import_linter_cache .hypothesis .benchmarks
	find rtcomp drivers tests tools -name __pycache__ -type d -prune -exec rm -rf {} +

# One at a time also under `make -j`: both install into the same environment.
$(DEV): pyproject.toml tools/setup.sh
	@tools/setup.sh dev

# A development environment can run the program; it need not be set up twice.
$(RUN): pyproject.toml tools/setup.sh
	@if [ $(DEV) -nt pyproject.toml ] && [ $(DEV) -nt tools/setup.sh ]; then touch $@; else tools/setup.sh run; fi
.NOTPARALLEL:
