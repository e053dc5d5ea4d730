#!/usr/bin/env bash
# Puts the FMU binaries of `make build` where the exporter of the program beside them looks first; of another
# build, where its folder is given. Where they are those of the last time, what is there stays, portable ones
# for instance, and counts as built anew.
set -euo pipefail
cd "$(dirname "$0")/../.."

built=${1:-target/release}
[ "$(uname -s)" = Linux ] || exit 0
case $(uname -m) in
x86_64) platform=linux64 ;;
*) platform=$(uname -m)-linux ;;
esac
folder=$built/fmu-binaries/$platform
last=$built/fmu-binaries/native
mkdir -p "$folder" "$last"
for name in ftc_controller ftc_plant; do
    library=$built/lib${name}_fmu.so
    # Tests build this library, too, with other features: the same sources may have been linked anew.
    if [ ! -f "$folder/$name.so" ] || ! cmp --silent "$library" "$last/$name.so"; then
        cp "$library" "$last/$name.so"
        cp "$library" "$folder/$name.so"
    fi
    touch "$folder/$name.so"
done
