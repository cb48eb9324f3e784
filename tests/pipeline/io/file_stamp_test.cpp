#include "pipeline/io/file_stamp.h"

#include <gtest/gtest.h>
#include <sys/sysmacros.h>

namespace texmesh::file_stamp_test {

struct stat status_on(dev_t device) {
  struct stat s {};
  s.st_dev = device;
  s.st_ino = 7;
  s.st_size = 100;
  s.st_mtim = {1000, 1};
  s.st_ctim = {1001, 2};
  return s;
}

/// NFS gives a file another st_dev on each node, all of them of major 0.
TEST(FileStamp, TheSameFileOfAMountIsTheSameOnEveryNode) {
  EXPECT_EQ(stamp_of(status_on(makedev(0, 45))), stamp_of(status_on(makedev(0, 312))));
}

TEST(FileStamp, FilesOfTwoDisksAreTwoFiles) {
  EXPECT_NE(stamp_of(status_on(makedev(8, 1))), stamp_of(status_on(makedev(8, 2))));
  EXPECT_NE(stamp_of(status_on(makedev(8, 1))), stamp_of(status_on(makedev(0, 45))));
}

TEST(FileStamp, ProvesNothingOfAFileChangedJustBeforeItWasLookedAt) {
  const FileStamp stamp = stamp_of(status_on(makedev(8, 1)));
  EXPECT_EQ(stamp.changed_ns, 1'001'000'000'002);
  EXPECT_FALSE(stamp.is_settled(stamp.changed_ns + FileStamp::kSettleNs));
  EXPECT_TRUE(stamp.is_settled(stamp.changed_ns + FileStamp::kSettleNs + 1));
}

}  // namespace texmesh::file_stamp_test
