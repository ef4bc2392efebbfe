#!/bin/sh
# Puts Kappaskin among this user's programs, and its files among the kinds that the desktop knows.
# Nothing is copied but that: the bundle stays where it is, and must.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
data=${XDG_DATA_HOME:-$HOME/.local/share}
mkdir -p "$data"
cp -R "$here/share/." "$data"
sed -i "s|^Exec=kappaskin|Exec=\"$here/kappaskin\"|" "$data/applications/kappaskin.desktop"
for update in "update-mime-database $data/mime" "update-desktop-database $data/applications"; do
    if command -v "${update%% *}" >/dev/null; then
        $update
    else
        echo "${update%% *} is not here: a desktop may not know the files (Debian: desktop-file-utils)"
    fi
done
echo "Kappaskin is installed for $(id -un): open it from the menu, or a recording by a double click"
