#!/bin/sh
# Installs a headless Chromium where there is none (Debian, Ubuntu). Running it again changes nothing.
set -eu
for name in chromium-headless-shell chromium chromium-browser google-chrome; do
    if command -v "$name" >/dev/null 2>&1; then
        echo "browser: $(command -v "$name")"
        exit 0
    fi
done
root() { if [ "$(id -u)" -eq 0 ]; then "$@"; else sudo "$@"; fi; }
root apt-get update -qq
root apt-get install -y -qq --no-install-recommends chromium-headless-shell fonts-dejavu-core ||
    root apt-get install -y -qq --no-install-recommends chromium fonts-dejavu-core
