# Image sizes; sourced by bench.sh and check.sh.

# Number of bytes in the sections of image $1 whose names match $2. Fails if there is none.
bytes() {
    local total=0 size sizes
    sizes=$(readelf -SW "$1" | sed 's/^ *\[ *[0-9]*\] *//' | awk -v s="^($2)\$" '$1 ~ s { print $5 }')
    [ -n "$sizes" ] || { echo "no section of $1 matches $2" >&2; return 1; }
    for size in $sizes; do
        total=$((total + 0x$size))
    done
    echo "$total"
}
