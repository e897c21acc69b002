# Image sizes; sourced by bench.sh and check.sh.

# Number of bytes in the sections of image $1 whose names match $2.
bytes() {
    local total=0 size
    for size in $(readelf -SW "$1" | sed 's/^ *\[ *[0-9]*\] *//' | awk -v s="^($2)\$" '$1 ~ s { print $5 }'); do
        total=$((total + 0x$size))
    done
    echo "$total"
}
