#!/bin/sh
# Counts what rays meet, with every choice that the compressed layout has: tables 1, 2, 6 and 8 of Ylitie et al. 2017.
# Writes a record a run into the folder that it is called with; on Mesa's CPU driver it takes half an hour.
set -eu
out=$1
runner=${RUNNER:-cargo run --release -p runner --}
scenes=${SCENES:-sphereflake sponza living_room bistro_interior kitchen}

# NAME VARIANT PARAMETER=VALUE…
count() {
    name=$1 variant=$2
    shift 2
    [ ! -e "$out/$name.json" ] || return 0
    settings="--set build.method=sbvh"
    for parameter; do settings="$settings --set $parameter"; done
    # shellcheck disable=SC2086
    $runner run $scenes --variant "$variant" --views 0,2,4,6 --size 160x90 --depth 5 --samples 1 --builds 1 --warm-up 0 \
        $settings --quiet -o "$out/$name.tmp.json" >"$out/$name.txt"
    mv "$out/$name.tmp.json" "$out/$name.json"
}

mkdir -p "$out"
wide='Wide8 Compressed'
count usual "$wide"
for order in distance random; do count "order-$order" "$wide" order.traversal=$order; done
for bits in 8 7 6 5 4; do count "bits-$bits" "$wide" order.traversal=distance layout.bits=$bits; done
count exact Wide8 contract.by-area=optimal trace.primary_vote=0 trace.secondary_vote=0 trace.postpone_below=0
for method in afra wald fixed; do count "contract-$method" "$wide" contract.by-area=$method; done
for assignment in greedy random; do count "assignment-$assignment" "$wide" order.assignment=$assignment; done
for cost in 0.0 0.1 0.2 0.4 0.5 1.0; do count "c_prim-$cost" "$wide" contract.c_prim=$cost; done
count ploc "$wide" build.method=ploc
count binary Binary
