#!/usr/bin/env bash
# Makes docs/l_bracket.png, the README's picture: the page of the L bracket in headless Chromium.
set -euo pipefail
cd "$(dirname "$0")/.."
page=$(mktemp --suffix .html)
trap 'rm -f "$page"' EXIT
polygrasp show models/l_bracket/l_bracket.sdf --html "$page"
chromium --headless --no-sandbox --hide-scrollbars --window-size=900,560 \
  --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader \
  --virtual-time-budget=4000 --screenshot=docs/l_bracket.png "file://$page"
