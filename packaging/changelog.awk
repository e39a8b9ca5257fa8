# awk -v version=0.1.0 -f changelog.awk CHANGELOG.md: the entries of that version as those of a Debian changelog, 78 columns wide.
function put(  words, count, i, line) {
  if (entry == "") return
  count = split(entry, words, /[ \t]+/)
  line = "  *"
  for (i = 1; i <= count; ++i) {
    if (length(line) + 1 + length(words[i]) > 78) { print line; line = "   " }
    line = line " " words[i]
  }
  print line
  entry = ""
}
/^## / { put(); inside = index($0, "## " version " ") == 1 || $0 == "## " version; next }
inside && /^- / { put(); entry = substr($0, 3); next }
inside && /^ +[^ ]/ { sub(/^ +/, ""); entry = entry " " $0; next }
END { put() }
