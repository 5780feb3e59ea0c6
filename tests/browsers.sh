#!/usr/bin/env bash
# Lists the browsers that the browser tests need but that are not installed, and how to install them (Debian 12). With `all`, the other browsers, too.
# Exit status: 0 Chromium is installed; 3 it is not, so no browser test can run; 1 a browser is missing and MAP3D_REQUIRE_BROWSERS is set.
set -euo pipefail

missing=()
chromium=installed
if ! [ -x "${CHROMIUM:-/usr/bin/chromium}" ]; then
  chromium=missing
  missing+=("Chromium|every browser test, $(ls viewer/test/browser/*.test.ts tests/whole/test_*.py | wc -l) files|apt install chromium, or set CHROMIUM=/path/to/chrome")
fi
if [ "${1:-}" = all ]; then
  [ -x "${FIREFOX:-/usr/bin/firefox-esr}" ] || missing+=("Firefox|the viewer in Firefox|apt install firefox-esr, or set FIREFOX=/path/to/firefox")
  [ -x /usr/bin/WebKitWebDriver ] || missing+=("WebKitGTK|the viewer in WebKitGTK|apt install webkit2gtk-driver")
  command -v Xvfb >/dev/null || missing+=("Xvfb|the viewer in Firefox and WebKitGTK|apt install xvfb libgl1-mesa-dri libegl1")
fi

if [ ${#missing[@]} -gt 0 ]; then
  echo
  echo "==================== BROWSER TESTS SKIPPED ===================="
  for row in "${missing[@]}"; do
    IFS='|' read -r name tests how <<<"$row"
    printf '%s is not installed. Skipped: %s.\n  To run them: %s\n' "$name" "$tests" "$how"
  done
  echo "==============================================================="
  [ -z "${MAP3D_REQUIRE_BROWSERS:-}" ] || { echo "MAP3D_REQUIRE_BROWSERS is set: missing browsers are an error." >&2; exit 1; }
fi
[ "$chromium" = installed ] || exit 3
