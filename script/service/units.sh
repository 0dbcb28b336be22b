# shellcheck shell=bash
# Words of systemd's units, for the scripts that write them. Sourced.

# Print these words as ExecStart= takes them: with % and $ twice, and quoted if they have spaces.
unit_words() {
    local word
    for word; do
        [[ $word != *[\"\\[:cntrl:]]* ]] || fail "a unit takes no word with \" or \\: $word"
        word=${word//%/%%} word=${word//\$/\$\$}
        [[ -n $word && $word != *[[:space:]\']* ]] || word="\"$word\""
        printf ' %s' "$word"
    done
}

# Read the words of a line of ExecStart= into the array `words`.
read_unit_words() {
    mapfile -d '' words < <(xargs -r printf '%s\0' <<<"$1")
    words=("${words[@]//%%/%}") words=("${words[@]//\$\$/\$}")
}
