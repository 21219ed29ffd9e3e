# make demo       a twin's log, identified by two methods, and a report        (under a minute after installation)
# make test       style, types, layers, the installed wheel, the quick tests  (under ten minutes)
# make test-long  the tests that take minutes
# make bench      accuracy and speed as tables
# make speed      speed as ratios to references in the same run; fails where one is worse than benchmarks/history allows
# make bench-ensemble  many runs at once beside scalar C programs; the last line is the ratio
# make peers      what other packages do with the same log and loop, into docs/benchmarks.md
# make compare-with REV=…  results of an old revision beside those of the working tree; QUICK=1, CASES=text, WORDS=1
# make docs       the documentation site into docs/_build/html, its gallery executed (two minutes)
# make venv       only set up .venv with the development tools (every target but demo does that first)

BIN := .venv/bin
PACKAGE := .venv/.package
STAMP := .venv/.installed

unexport PYTHONDONTWRITEBYTECODE  # bytecode is kept: the tests start a hundred processes that import the package

.PHONY: demo test test-long docs bench speed bench-ensemble peers compare-with venv format style types layers wheel unit clean

demo: $(PACKAGE)
	@$(BIN)/python examples/demo.py

test: style types layers wheel unit

test-long: $(STAMP)
	@echo "== long tests"
	@$(BIN)/python -m pytest -m long -n 2 --maxschedchunk=1 --durations=20

docs: $(STAMP)
	@echo "== documentation site (Sphinx)"
	@$(BIN)/python tools/build_docs.py

bench: $(STAMP)
	@set -e; for script in $(filter-out benchmarks/test_%,$(wildcard benchmarks/*.py)); do echo "== $$script"; $(BIN)/python "$$script"; done
	@echo "== benchmarks/test_kernels.py"
	@$(BIN)/python -m pytest benchmarks/test_kernels.py --benchmark-enable --benchmark-only --benchmark-columns=min,median,rounds

speed: $(STAMP)
	@$(BIN)/python benchmarks/speed --check

peers: $(STAMP)
	@$(BIN)/python benchmarks/peers

bench-ensemble: $(STAMP)
	@$(BIN)/python benchmarks/ensemble/ensemble.py

compare-with: $(STAMP)
	@test -n "$(REV)" || { echo "give the old revision: make compare-with REV=main"; exit 2; }
	@PYTHONPATH=tools $(BIN)/python -m compare_with "$(REV)" $(if $(QUICK),--quick) $(if $(WORDS),--words) $(if $(ALL),--all) $(if $(STRICT),--strict) $(if $(FRESH),--fresh) $(if $(CASES),--cases "$(CASES)")

venv: $(STAMP)

format: $(STAMP)
	@$(BIN)/ruff check --fix .
	@$(BIN)/ruff format .

style: $(STAMP)
	@echo "== style (ruff)"
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .

types: $(STAMP)
	@echo "== types (mypy)"
	@$(BIN)/mypy

layers: $(STAMP)
	@echo "== layers (import-linter), circles of files"
	@$(BIN)/lint-imports
	@$(BIN)/python tools/import_circles.py

wheel: $(STAMP)
	@echo "== the wheel, installed in an empty environment"
	@bash tests/check_wheel.sh $(abspath $(BIN)/python)

unit: $(STAMP)
	@echo "== tests (pytest)"
	@$(BIN)/python -m pytest -n 2

clean:
	rm -rf .venv build dist out .mypy_cache .ruff_cache .pytest_cache .hypothesis .benchmarks .import_linter_cache docs/_build

$(PACKAGE): pyproject.toml tools/venv.sh
	@bash tools/venv.sh .venv
	@touch $@

$(STAMP): pyproject.toml tools/venv.sh
	@bash tools/venv.sh .venv dev
	@touch $@ $(PACKAGE)
