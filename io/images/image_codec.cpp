#include "io/images/image_codec.h"

#include <dlfcn.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "io/base/error.h"

namespace megablock {

namespace {

constexpr const char* kLibrary = "libmegablock_image_codecs.so";

ImageCodecs load_codecs() {
  void* library = dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL);  // stays loaded until the process ends
  void* symbol = library == nullptr ? nullptr : dlsym(library, "megablock_image_codecs");
  if (symbol == nullptr)
    throw InputError(std::string("image files cannot be read or written: ") + dlerror() +
                     "; it belongs beside the program, or where 'cmake --install' puts it");
  return reinterpret_cast<decltype(&megablock_image_codecs)>(symbol)();
}

const ImageCodecs& codecs() {
  // A static variable is initialised once, also with several threads.
  static const ImageCodecs loaded = load_codecs();
  return loaded;
}

}  // namespace

void load_image_codecs() { codecs(); }

cv::Mat decode_image(const std::vector<unsigned char>& file, int flags) { return codecs().decode(file, flags); }

cv::Mat read_image_file(const std::string& path, int flags) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<unsigned char> bytes(std::istreambuf_iterator<char>(file), {});
  return bytes.empty() ? cv::Mat() : decode_image(bytes, flags);
}

std::vector<unsigned char> encode_image(const std::string& extension, const cv::Mat& image,
                                        const std::vector<int>& parameters) {
  std::vector<unsigned char> bytes = codecs().encode(extension, image, parameters);
  if (bytes.empty()) throw ComputeError("OpenCV cannot encode an image as " + extension);
  return bytes;
}

void write_image_file(const std::string& path, const cv::Mat& image, const std::vector<int>& parameters) {
  const std::vector<unsigned char> bytes =
      encode_image(std::filesystem::path(path).extension().string(), image, parameters);
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), std::ssize(bytes));
  if (!file.flush()) throw InputError(path + ": cannot be written");
}

}  // namespace megablock
