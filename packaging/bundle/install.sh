#!/bin/sh
# Puts Kappaskin among this user's programs, and its files among the kinds that the desktop knows.
# Nothing is copied but that: the bundle stays where it is, and must.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
data=${XDG_DATA_HOME:-$HOME/.local/share}
mkdir -p "$data"
cp -R "$here/share/." "$data"
# As a command of a desktop entry has it, and then as sed does.
told=$(printf '%s' "$here" | sed 's/\\/\\\\\\\\/g; s/["`$]/\\\\&/g; s/%/%%/g' | sed 's/[&|\\]/\\&/g')
sed -i "s|^Exec=kappaskin|Exec=\"$told/kappaskin\"|" "$data/applications/kappaskin.desktop"
update() {
    if command -v "$1" >/dev/null; then
        "$1" "$2"
    else
        echo "$1 is not here: a desktop may not know the files (Debian: desktop-file-utils)"
    fi
}
update update-mime-database "$data/mime"
update update-desktop-database "$data/applications"
echo "Kappaskin is installed for $(id -un): open it from the menu, or a recording by a double click"
