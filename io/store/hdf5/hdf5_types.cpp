#include "io/store/hdf5/hdf5_types.h"

namespace megablock {

hid_t memory_type(ElementType type) {
  switch (type) {
    case ElementType::kInt8:
      return H5T_NATIVE_INT8;
    case ElementType::kUint8:
      return H5T_NATIVE_UINT8;
    case ElementType::kInt16:
      return H5T_NATIVE_INT16;
    case ElementType::kUint16:
      return H5T_NATIVE_UINT16;
    case ElementType::kInt32:
      return H5T_NATIVE_INT32;
    case ElementType::kUint32:
      return H5T_NATIVE_UINT32;
    case ElementType::kInt64:
      return H5T_NATIVE_INT64;
    case ElementType::kUint64:
      return H5T_NATIVE_UINT64;
    case ElementType::kFloat:
      return H5T_NATIVE_FLOAT;
    case ElementType::kDouble:
      break;
  }
  return H5T_NATIVE_DOUBLE;
}

hid_t file_type(ElementType type) {
  switch (type) {
    case ElementType::kInt8:
      return H5T_STD_I8LE;
    case ElementType::kUint8:
      return H5T_STD_U8LE;
    case ElementType::kInt16:
      return H5T_STD_I16LE;
    case ElementType::kUint16:
      return H5T_STD_U16LE;
    case ElementType::kInt32:
      return H5T_STD_I32LE;
    case ElementType::kUint32:
      return H5T_STD_U32LE;
    case ElementType::kInt64:
      return H5T_STD_I64LE;
    case ElementType::kUint64:
      return H5T_STD_U64LE;
    case ElementType::kFloat:
      return H5T_IEEE_F32LE;
    case ElementType::kDouble:
      break;
  }
  return H5T_IEEE_F64LE;
}

void silence_hdf5() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

std::string last_hdf5_failure() {
  std::string description;
  const auto visit = [](unsigned, const H5E_error2_t* entry, void* data) -> herr_t {
    auto& found = *static_cast<std::string*>(data);
    if (found.empty() && entry->desc) found = entry->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, visit, &description);
  return description;
}

Hdf5Handle file_access() {
  Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), &H5Pclose);
  // One version of the format, so that the superblock has the layout that the writer relies on (kEndOfFile).
  H5Pset_libver_bounds(access.id(), H5F_LIBVER_LATEST, H5F_LIBVER_LATEST);
  H5Pset_file_locking(access.id(), false, true);
  // H5Fclose then really closes the file, also if a dataset is still open.
  H5Pset_fclose_degree(access.id(), H5F_CLOSE_STRONG);
  return access;
}

}  // namespace megablock
