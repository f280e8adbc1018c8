#include "io/project/inputs/image_lookup.h"

#include <gmock/gmock.h>

namespace megablock {
namespace {

using LookupKind = ImageLookup::Kind;

Block block_with(const std::vector<std::string>& names) {
  Block block;
  for (const std::string& name : names) block.add_image(name, {});
  return block;
}

TEST(ImageLookup, FindsTheNamesThatPeopleWrite) {
  const Block block = block_with({"IMG_1.jpg", "IMG_2.JPG", "1.5.tif"});
  const ImageLookup images(block, {});
  const auto place = [&](const std::string& name) {
    const ImageLookup::Found found = images.find(name);
    return found.kind == LookupKind::kImage ? found.image.value : -1;
  };
  for (const char* name : {"IMG_1.jpg", "img_1.JPG", "IMG_1", "images/IMG_1.jpg", "C:\\flight 1\\IMG_1.JPG",
                           "./IMG_1.jpg", " IMG_1.jpg ", "/data/images/img_1", "IMG_1.tif"})
    EXPECT_EQ(place(name), 0) << name;
  EXPECT_EQ(place("IMG_2.jpg"), 1);
  EXPECT_EQ(place("1.5"), 2);
  for (const char* name : {"IMG_3.jpg", "", "IMG", "IMG_1.jpg/a"}) EXPECT_EQ(place(name), -1) << name;
}

TEST(ImageLookup, NeverTakesTheImageOfAnotherFolder) {
  const Block block = block_with({"flight1/1.jpg", "flight1/2.jpg", "flight2/1.jpg"});
  const ImageLookup images(block, {});
  EXPECT_EQ(images.find("images/flight2/1.jpg").image, ImageIndex(2));
  EXPECT_EQ(images.find("2.jpg").image, ImageIndex(1)) << "only one image has this name";
  EXPECT_EQ(images.find("1.jpg").kind, LookupKind::kAmbiguous);
  EXPECT_EQ(images.find("flight2/2.jpg").kind, LookupKind::kAbsent);
  const Block one_folder = block_with({"DCIM/100MEDIA/1.jpg", "DCIM/100MEDIA/2.jpg"});
  EXPECT_EQ(ImageLookup(one_folder, {}).find("/home/anna/flight/2.jpg").image, ImageIndex(1));
}

TEST(ImageLookup, KnowsImagesThatWereLeftOut) {
  const Block block = block_with({"1.jpg", "2.jpg"});
  const ImageLookup images(block, {"3.jpg"});
  EXPECT_EQ(images.find("images/3.JPG").kind, LookupKind::kLeftOut);
  EXPECT_EQ(images.find("4.jpg").kind, LookupKind::kAbsent);
}

TEST(ImageLookup, AsWrittenCountsBeforeOtherCase) {
  const Block block = block_with({"a.jpg", "A.jpg", "a.png"});
  const ImageLookup images(block, {});
  EXPECT_EQ(images.find("A.jpg").image, ImageIndex(1));
  EXPECT_EQ(images.find("a.PNG").image, ImageIndex(2));
  EXPECT_EQ(images.find("a").kind, LookupKind::kAmbiguous);
}

}  // namespace
}  // namespace megablock
