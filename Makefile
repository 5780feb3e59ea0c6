# map3d: `make` lists the verbs.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CACHE := .cache
RUST := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock
VIEWER := $(shell find viewer/src viewer/page viewer/scripts -type f 2>/dev/null) $(wildcard viewer/*.json viewer/*.ts viewer/*.js viewer/*.mjs)

.PHONY: help demo test test-all test-rust test-python test-viewer test-wheel test-browser browser-suite wheel check check-rust check-python check-viewer bench bench-extent bench-cycles bench-rotterdam bench-viewer peers bless docs reference build clean tools

help: ## this list
	@echo "map3d: 3D city models as oblique image tiles"; echo
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 20
	@$(MAKE) --no-print-directory -s tools

tools:
	@missing=""; \
	need() { command -v $$1 >/dev/null 2>&1 || missing="$$missing\n  $$1: $$2"; }; \
	need cargo "Rust stable (rustup)"; need node "Node.js 20 or newer"; need npm "npm, with Node.js"; need cc "apt install build-essential"; \
	need $(PYTHON) "Python 3.11 or newer"; \
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || missing="$$missing\n  python: 3.11 or newer (PYTHON=… names another)"; \
	$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || missing="$$missing\n  venv: apt install python3-venv"; \
	if [ -n "$$missing" ]; then echo; echo -e "Missing on this machine:$$missing"; exit 1; fi

# -- build ---------------------------------------------------------------------------------------------------------------------------

$(CACHE)/venv: requirements/dev.lock requirements/peers.lock | $(CACHE)
	@$(MAKE) --no-print-directory -s tools
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install -q --disable-pip-version-check -r requirements/dev.lock -r requirements/peers.lock
	@touch $@

$(CACHE)/core: $(RUST) pyproject.toml $(CACHE)/venv
	$(BIN)/maturin develop --release --locked -q
	@touch $@

$(CACHE)/npm: viewer/package-lock.json | $(CACHE)
	cd viewer && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error
	@touch $@

$(CACHE)/viewer: $(VIEWER) $(CACHE)/npm
	cd viewer && npm run --silent build
	rm -rf python/map3d/viewer && cp -r viewer/dist python/map3d/viewer
	@touch $@

$(CACHE):
	@mkdir -p $@

build: $(CACHE)/core $(CACHE)/viewer ## compile the core and the viewer into .venv

wheel: build ## build dist/map3d-*.whl: abi3, manylinux, with the viewer inside
	rm -f dist/map3d-*.whl
	$(BIN)/maturin build --release --locked -q -o dist
	@ls -sh dist/map3d-*.whl

# -- use -----------------------------------------------------------------------------------------------------------------------------

demo: build ## generate a town, render it, serve it on a free port and print the address of its map
	$(BIN)/map3d demo --folder demo

# -- test ----------------------------------------------------------------------------------------------------------------------------

test: test-rust test-python test-viewer test-wheel test-browser ## all quick tests, also in a real browser

test-rust:
	cargo test --workspace --locked --exclude map3d-py --lib --tests -q

test-python: build
	$(BIN)/python -m pytest -q -m "not browser and not slow and not wheel"

test-viewer: $(CACHE)/npm
	cd viewer && npm test --silent

test-wheel: wheel ## install the wheel into an empty environment, without Rust and Node.js, and run it
	$(BIN)/python -m pytest -q -m wheel

test-browser: build ## whole-way tests in Chromium, Firefox and WebKitGTK; skipped, loudly, where a browser is not installed
	@status=0; tests/browsers.sh || status=$$?; \
	case $$status in 0) $(MAKE) --no-print-directory browser-suite;; 3) ;; *) exit $$status;; esac

browser-suite: build
	cd viewer && npm run --silent test:browser
	$(BIN)/python -m pytest -q -m browser

test-all: test ## also what takes long (nothing is marked slow yet)

# -- check ---------------------------------------------------------------------------------------------------------------------------

check: check-rust check-python check-viewer ## format, lint, types, sizes

check-rust: $(CACHE)/venv
	cargo fmt --all --check
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo clippy --workspace --all-targets --locked -q -- -D warnings

check-python: build
	$(BIN)/ruff check python tests spec bench docs
	$(BIN)/ruff format --check python tests spec bench docs
	$(BIN)/mypy
	$(BIN)/lint-imports

check-viewer: $(CACHE)/viewer
	cd viewer && npm run --silent lint && npm run --silent typecheck && npm run --silent size && npm run --silent docs:check

# -- keep --------------------------------------------------------------------------------------------------------------------------

bench: build ## speed and memory, peers beside us; then a twentieth of bench-rotterdam
	$(BIN)/python -m bench
	$(BIN)/python -m bench.rotterdam --scale 20

bench-extent: build ## a town that grows to 75 million triangles, in one memory: an hour, 30 GB of disk
	$(BIN)/python -m bench extent --millions 1 3 10 30 75

bench-cycles: requirements/cycles.lock | $(CACHE) ## install Blender (350 MB) in a Python of its own, a further peer of `make bench`
	$(PYTHON) -m venv $(CACHE)/cycles
	$(CACHE)/cycles/bin/python -m pip install -q --disable-pip-version-check -r requirements/cycles.lock

bench-viewer: build peers ## map3d.js beside CesiumJS, OpenSeadragon and Leaflet (npm, 230 MB), cities to 10 million triangles: 2 hours and 9 GB of disk
	$(BIN)/python -m bench viewer

peers:
	cd bench/viewer && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error || echo "NO PEERS: npm could not install them" >&2

bench-rotterdam: build ## a city of 62,000 buildings from nothing to a published folder: hours, 45 GB of disk
	$(BIN)/python -m bench.rotterdam

docs: build reference peers ## the pictures (beside CesiumJS: npm, 230 MB) and the command line's reference in docs/; the viewer's reference
	$(BIN)/python docs/make_cli.py
	$(BIN)/python docs/pictures/make.py .cache/pictures

reference: $(CACHE)/npm ## the viewer's reference as pages, viewer/reference/
	cd viewer && npm run --silent docs

bless: $(CACHE)/venv $(CACHE)/npm ## write test vectors and golden pictures anew; look at them, and say why in the commit
	$(BIN)/python spec/make_vectors.py
	MAP3D_BLESS=1 cargo test --locked -q -p map3d-render --test golden
	cd viewer && npm run --silent bless

clean: ## remove what was built
	rm -rf $(VENV) $(CACHE) target viewer/node_modules viewer/dist viewer/reference python/map3d/viewer dist demo tests/.out
