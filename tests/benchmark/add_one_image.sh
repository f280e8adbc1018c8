#!/bin/bash
# Measures the cost of one image that is added to a finished job: the number of computed units by stage, and the
# processor time of both runs.
#
# usage: add_one_image.sh MEGABLOCK FOLDER [IMAGES [IMAGE]]
#   IMAGES  folder of images (default: seneca of $MEGABLOCK_DATA); IMAGE  the one added last (default: IMG_0557.jpg)
# Works in FOLDER, which must not exist.
set -eu
megablock=$(realpath "$1"); folder=$2
images=${3:-${MEGABLOCK_DATA:-$(dirname "$0")/../../../shared/data}/seneca}
image=${4:-IMG_0557.jpg}

mkdir -p "$folder/images"
cp "$images"/*.jpg "$folder/images/"
mv "$folder/images/$image" "$folder/"
cd "$folder"
"$megablock" init images -o block.yaml
time "$megablock" run block.yaml -j job -q || [ $? = 1 ]
find job -name '*.h5' -path '*/0*' -printf '%P %T@\n' | sort > before.txt

mv "$image" images/
time "$megablock" run block.yaml -j job -q || [ $? = 1 ]
find job -name '*.h5' -path '*/0*' -printf '%P %T@\n' | sort > after.txt

echo "unit files that are new or were written again:"
comm -13 before.txt after.txt | cut -d' ' -f1
python3 - <<'END'
import collections, json, pathlib
first, second = [[json.loads(line) for line in file.read_text().splitlines()] for file in sorted(pathlib.Path("job/events").iterdir())]
stages = list(dict.fromkeys(event["stage"] for event in first))
count = [collections.Counter(event["stage"] for event in run) for run in (first, second)]
seconds = [{stage: sum(e["seconds"] for e in run if e["stage"] == stage) for stage in stages} for run in (first, second)]
print(f"{'stage':12} {'units':>6} {'s':>8}   {'added':>6} {'s':>8}")
for stage in stages:
    print(f"{stage:12} {count[0][stage]:6} {seconds[0][stage]:8.1f}   {count[1][stage]:6} {seconds[1][stage]:8.1f}")
END
