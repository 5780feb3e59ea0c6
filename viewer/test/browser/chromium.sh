#!/usr/bin/env bash
# Chromium without the two pages of its address bar, which each window loads and tests never see. Path: CHROMIUM, else Debian's.
exec "${CHROMIUM:-/usr/bin/chromium}" "${@/#--disable-features=/--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup,}"
