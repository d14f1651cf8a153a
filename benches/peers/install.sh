#!/usr/bin/env bash
# Installs what `residual-bench peers` compares residuald with. What is there already is left as it is.
#
#   libeigen3-dev, g++, cyclonedds-tools   Debian packages: as root, or with sudo that asks nothing
#   numpy, filterpy                        from PyPI into a virtual environment
#   zenoh-latency                          built with Cargo from benches/peers/zenoh: some 250 crates, minutes
#
# Everything but the Debian packages goes into the directory `peers` of Cargo's target directory. A part that cannot be
# installed is named; the comparison leaves it out. The exit status is the number of such parts.
set -u
here=$(cd "$(dirname "$0")" && pwd)
peers=${CARGO_TARGET_DIR:-$here/../../target}/peers
mkdir -p "$peers"
missing=0

absent() {
    echo "not installed: $1" >&2
    missing=$((missing + 1))
}

debian() {
    local packages=()
    [ -f /usr/include/eigen3/Eigen/Dense ] || packages+=(libeigen3-dev)
    command -v g++ >/dev/null || packages+=(g++)
    command -v ddsperf >/dev/null || packages+=(cyclonedds-tools)
    python3 -c 'import ensurepip' 2>/dev/null || packages+=(python3-venv)
    [ ${#packages[@]} -eq 0 ] && return
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        if ! sudo -n true 2>/dev/null; then
            absent "${packages[*]}: run as root: apt-get install --no-install-recommends ${packages[*]}"
            return
        fi
        as_root=(sudo -n)
    fi
    if ! command -v apt-get >/dev/null; then
        absent "${packages[*]}: no apt-get; install them as your system does"
    elif ! { "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${packages[@]}"; }; then
        absent "${packages[*]}: apt-get failed"
    fi
}

python() {
    local environment=$peers/python
    "$environment/bin/python" -c 'import numpy, filterpy' 2>/dev/null && return
    if ! { python3 -m venv "$environment" && "$environment/bin/pip" install --quiet numpy filterpy; }; then
        absent "numpy, filterpy: $environment"
    fi
}

zenoh() {
    # Cargo does nothing if nothing has changed.
    if ! cargo build --release --locked --manifest-path "$here/zenoh/Cargo.toml" --target-dir "$peers/zenoh"; then
        absent "zenoh-latency: cargo build failed"
    fi
}

debian
python
zenoh
echo "peers: $peers"
exit "$missing"
