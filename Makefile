# run: the main job; test: everything that must hold. Both install what is missing first.
CORES ?= 2
BIN := .venv/bin

.PHONY: run test setup lint format docs lock

run: setup
	$(BIN)/snakemake --cores $(CORES)

test: setup lint
	$(BIN)/python -m pytest -q

setup:
	@tools/setup

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/snakefmt --check Snakefile rules
	$(BIN)/snakemake --lint

format: setup
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/snakefmt Snakefile rules

docs: setup
	PYTHONPATH=scripts $(BIN)/python -m dapple.config.docs
	$(BIN)/python tools/pages.py

lock: setup
	$(BIN)/uv pip compile pyproject.toml --group dev --generate-hashes --universal --no-header --quiet -o requirements.lock
