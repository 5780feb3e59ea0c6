# map3d: `make` lists the targets.

SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
# Tests start thousands of processes, which would each compile all modules.
unexport PYTHONDONTWRITEBYTECODE

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
CACHE := .cache
RUST := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml Cargo.lock
VIEWER := $(shell find viewer/src viewer/page viewer/scripts -type f 2>/dev/null) $(wildcard viewer/*.json viewer/*.ts viewer/*.js viewer/*.mjs)

.PHONY: help demo test test-all test-rust test-python mongo-server test-viewer test-wheel test-browser test-browsers browser-suite test-more test-more-python wheel check check-words check-rust check-python check-viewer bench bench-extent bench-cycles bench-rotterdam bench-viewer bench-serve peers faults bless docs reference build test-build clean tools

help: ## list the targets
	@echo "map3d: 3D city models as oblique image tiles"; echo
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/  make \1\t\2/' | expand -t 26
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

CARGO_TEST := PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo test --workspace --tests --locked
TEST_CORE := $(CACHE)/$(if $(wildcard $(CACHE)/core),core,checked-core)

# The core in the profile of the Rust tests, which compiles their parts once and checks overflows and assertions. A core that is in use is tested as it is.
$(CACHE)/checked-core: $(RUST) pyproject.toml $(CACHE)/venv
	$(CARGO_TEST) -q --no-run
	$(BIN)/maturin develop --locked -q
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

test-build: $(TEST_CORE) $(CACHE)/viewer

wheel: $(CACHE)/viewer ## build dist/map3d-*.whl: abi3, manylinux, with the viewer inside
	rm -f dist/map3d-*.whl
	$(BIN)/maturin build --release --locked -q -o dist
	@ls -sh dist/map3d-*.whl

# -- use -----------------------------------------------------------------------------------------------------------------------------

demo: build ## generate a town, render it, serve it on a free port and print the address of its map
	$(BIN)/map3d demo --folder demo

# -- test ----------------------------------------------------------------------------------------------------------------------------

test: ## run the tests that guard map3d's own laws, including those in a browser
	@$(MAKE) --no-print-directory -j 3 test-build mongo-server
	@$(MAKE) --no-print-directory test-rust test-python test-viewer test-browser

test-browsers: test-build ## test the viewer in Firefox and WebKitGTK, and with bundlers; skips browsers that are not installed, and says so
	@status=0; tests/browsers.sh all || status=$$?; \
	case $$status in 0) cd viewer && npx --no-install vitest run --config vitest.agreement.config.ts;; 3) ;; *) exit $$status;; esac

test-rust: $(CACHE)/venv
	$(CARGO_TEST) -q

# Two files at a time; tests/conftest.py names those that never run at the same time.
PYTEST := $(BIN)/python -m pytest -q -n 2 --dist loadgroup

test-python: test-build mongo-server
	$(PYTEST) -m "not browser and not wheel and not third_party and not endurance"

MONGO := tests/catalogue/mongo_server
mongo-server: | $(CACHE) # fetch and compile the server of the MongoDB tests, which are skipped without it
	@test $(CACHE)/mongo-server/MongoServerMain.class -nt $(MONGO)/MongoServerMain.java || { \
	mvn -q -B -f $(MONGO)/pom.xml dependency:copy-dependencies -DoutputDirectory=$(CURDIR)/$(CACHE)/mongo-server/jars && \
	javac -cp '$(CACHE)/mongo-server/jars/*' -d $(CACHE)/mongo-server $(MONGO)/MongoServerMain.java; } || \
	echo "cannot fetch or compile the test server of MongoDB (apt install maven default-jdk-headless); its tests will be skipped" >&2

test-viewer: $(CACHE)/npm
	cd viewer && npm test --silent

test-wheel: wheel ## install the wheel into an empty environment without Rust and Node.js, and run it
	$(BIN)/python -m pytest -q -m wheel

test-browser: test-build ## test in Chromium; skips the tests if it is not installed, and says so
	@status=0; tests/browsers.sh || status=$$?; \
	case $$status in 0) $(MAKE) --no-print-directory browser-suite;; 3) ;; *) exit $$status;; esac

browser-suite: test-build
	cd viewer && npx --no-install vitest run --config vitest.browser.config.ts
	$(BIN)/python -m pytest -q -m browser

test-all: test test-more ## run all tests: also agreement with programs of others, endurance and the wheel

test-more: test-more-python test-browsers test-wheel # what test-all runs beyond test

test-more-python: test-build mongo-server
	$(PYTEST) -m "(third_party or endurance) and not browser"

faults: test-build ## kill, fill disks, fail system calls: every tile set must equal the undisturbed one (docs/reliability.md): 2 hours
	$(BIN)/python -m tests.faults

# -- check ---------------------------------------------------------------------------------------------------------------------------

check: $(CACHE)/venv $(CACHE)/viewer ## check words, format, lint, types and sizes, two parts at a time
	@$(MAKE) --no-print-directory -j 2 --output-sync=target check-rust check-python check-viewer check-words

check-words: $(CACHE)/venv
	$(BIN)/python docs/check_words.py

check-rust: $(CACHE)/venv
	cargo fmt --all --check
	PYO3_PYTHON=$(CURDIR)/$(BIN)/python cargo clippy --workspace --all-targets --locked -q -- -D warnings

check-python: $(CACHE)/venv
	$(BIN)/ruff check python tests spec bench docs
	$(BIN)/ruff format --check python tests spec bench docs
	$(BIN)/mypy
	PYTHONPATH=python $(BIN)/lint-imports

check-viewer: $(CACHE)/viewer
	cd viewer && npm run --silent lint && npm run --silent typecheck && npm run --silent size && npm run --silent docs:check

# -- keep --------------------------------------------------------------------------------------------------------------------------

bench: build ## measure speed and memory beside peers, then a twentieth of bench-rotterdam
	$(BIN)/python -m bench
	$(BIN)/python -m bench.rotterdam --scale 20

bench-extent: build ## measure towns of up to 75 million triangles within a fixed memory limit: 1 hour, 30 GB of disk
	$(BIN)/python -m bench extent --millions 1 3 10 30 75

bench-cycles: requirements/cycles.lock | $(CACHE) ## install Blender (350 MB) in its own Python environment, as another peer of `make bench`
	$(PYTHON) -m venv $(CACHE)/cycles
	$(CACHE)/cycles/bin/python -m pip install -q --disable-pip-version-check -r requirements/cycles.lock

bench-serve: build ## measure served tiles beside nginx and during a flood of views (apt install nginx-light wrk): 6 minutes
	$(BIN)/python -m bench.serve

bench-viewer: build peers ## measure map3d.js beside CesiumJS, OpenSeadragon and Leaflet (npm, 230 MB): 2 hours, 9 GB of disk
	$(BIN)/python -m bench viewer

peers:
	cd bench/viewer && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error || echo "npm could not install the peers; they are skipped" >&2

bench-rotterdam: build ## measure a city of 62,000 buildings from files to a published folder: hours, 45 GB of disk
	$(BIN)/python -m bench.rotterdam

docs: build reference peers ## regenerate the pictures (CesiumJS from npm, 230 MB) and command reference in docs/, and the viewer's reference
	$(BIN)/python docs/make_cli.py
	$(BIN)/python docs/make_map.py
	$(BIN)/python docs/pictures/make.py .cache/pictures

reference: $(CACHE)/npm ## write the viewer's reference to viewer/reference/
	cd viewer && npm run --silent docs

bless: $(CACHE)/venv $(CACHE)/npm ## regenerate test vectors and golden pictures; look at them and say why in the commit
	$(BIN)/python spec/make_vectors.py
	MAP3D_BLESS=1 cargo test --locked -q -p map3d-render --test all golden
	cd viewer && npm run --silent bless

clean: ## remove all build output
	rm -rf $(VENV) $(CACHE) target viewer/node_modules viewer/dist viewer/reference python/map3d/viewer dist demo tests/.out
