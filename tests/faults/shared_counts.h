#pragma once
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <stdexcept>
#include <string>

#include "tests/faults/fault_plan.h"

namespace texmesh::testing {

/// The file that the processes under the shim share with this one.
class SharedCounts {
 public:
  explicit SharedCounts(const std::string& file) : file_(file) {
    const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (fd < 0 || ::ftruncate(fd, sizeof(FaultCounts)) != 0) throw std::runtime_error(file);
    void* place = ::mmap(nullptr, sizeof(FaultCounts), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    ::close(fd);
    if (place == MAP_FAILED) throw std::runtime_error(file);
    counts_ = static_cast<FaultCounts*>(place);
  }
  ~SharedCounts() { ::munmap(counts_, sizeof(FaultCounts)); }
  SharedCounts(const SharedCounts&) = delete;
  SharedCounts& operator=(const SharedCounts&) = delete;
  const FaultCounts& operator*() const { return *counts_; }
  const std::string& file() const { return file_; }

 private:
  std::string file_;
  FaultCounts* counts_;
};

}  // namespace texmesh::testing
