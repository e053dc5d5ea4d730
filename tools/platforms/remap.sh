#!/usr/bin/env bash
# Prints CARGO_ENCODED_RUSTFLAGS with the given flags and those that keep the paths of this machine out
# of a binary: the places of panics are then said by crate alone.
set -euo pipefail
cd "$(dirname "$0")/../.."

# The folder of sources has a name only once something is in it.
compgen -G "${CARGO_HOME:-$HOME/.cargo}/registry/src/[!-]*/" >/dev/null || cargo fetch --quiet --locked >&2

flags=("$@" "--remap-path-prefix=$PWD/=")
# Without the folders, named "-...", that cargo package leaves there: other flags build everything anew,
# and what was built last is what is exported.
for index in "${CARGO_HOME:-$HOME/.cargo}"/registry/src/[!-]*/; do
    flags+=("--remap-path-prefix=$index=")
done
# The standard library's sources, where they are installed or built along.
flags+=("--remap-path-prefix=$("${RUSTC:-rustc}" --print sysroot)/lib/rustlib/src/rust=rust")
(IFS=$'\x1f' && printf '%s' "${flags[*]}")
