#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>

#include "format/container/layout.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/command.h"
#include "tests/support/packages.h"
#include "tools/inspect/package_tree.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::package_tree_test {

namespace fs = std::filesystem;

using testing::files_beneath;
using testing::read_text;
using testing::TemporaryFolder;
using testing::write_text;

std::string text_of(const Bytes& b) { return {b.begin(), b.end()}; }

struct Tree : ::testing::Test {
  Tree() { write_text(folder / "a.texmesh", text_of(package)); }
  std::string verify(const std::string& path) const {
    const auto store = open_store(path);
    std::string text;
    for (const Finding& f : verify_package(*store, {}).findings) text += to_string(f) + "\n";
    return text;
  }
  /// Only the given names stand in the test's folder: nothing temporary was left.
  void expect_names(std::vector<std::string> names) const {
    std::vector<std::string> found;
    for (const auto& e : fs::directory_iterator(folder.path())) found.push_back(e.path().filename().string());
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, names);
  }
  TemporaryFolder folder;
  const Bytes package = testing::make_package_parts().build();
};

TEST_F(Tree, PackAfterUnpackGivesTheSameBytes) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  EXPECT_EQ(verify(folder / "tree"), "");
  EXPECT_EQ(files_beneath(folder / "tree").size(), 14u + 1);
  pack_folder(folder / "tree", folder / "b.texmesh");
  EXPECT_EQ(read_text(folder / "b.texmesh"), text_of(package));
  expect_names({"a.texmesh", "b.texmesh", "tree"});
}

TEST_F(Tree, AContentCredentialStaysTheLastEntryAndIsNotChecked) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  fs::create_directory(folder / "tree/META-INF");
  write_text((folder.path() / "tree" / kContentCredentialPath).string(), "not really signed");
  EXPECT_EQ(verify(folder / "tree"), "");
  pack_folder(folder / "tree", folder / "signed.texmesh");
  EXPECT_EQ(verify(folder / "signed.texmesh"), "");
  const auto store = open_store(folder / "signed.texmesh");
  EXPECT_EQ(store->list().back().path, kContentCredentialPath);
  EXPECT_TRUE(verify_package(*store, {}).content_credential);
  EXPECT_FALSE(verify_package(*open_store(folder / "a.texmesh"), {}).content_credential);
  EXPECT_EQ(PackageReader(open_store(folder / "signed.texmesh")).id(),
            PackageReader(open_store(folder / "a.texmesh")).id());
  unpack_package(folder / "signed.texmesh", folder / "again", {});
  EXPECT_EQ(read_text((folder.path() / "again" / kContentCredentialPath).string()), "not really signed");
  fs::remove_all(fs::path(folder / "tree/META-INF"));
  pack_folder(folder / "tree", folder / "b.texmesh");
  EXPECT_EQ(read_text(folder / "b.texmesh"), text_of(package));
}

// O08: a claim hashes every other entry, and the directory without the CRC-32 of the credential. So the bytes
// of the credential, which are known last, change nothing that it has hashed.
TEST_F(Tree, NothingThatAClaimHashesDependsOnTheCredential) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  fs::create_directory(folder / "tree/META-INF");
  const auto packed_with = [&](const std::string& credential, const char* name) {
    write_text((folder.path() / "tree" / kContentCredentialPath).string(), credential);
    pack_folder(folder / "tree", folder / name);
    return read_text(folder / name);
  };
  const std::string before = packed_with("room for a claim", "before.texmesh");
  const std::string after = packed_with("ROOM FOR A CLAIM", "after.texmesh");
  ASSERT_EQ(before.size(), after.size());
  const ContainerEntry credential = open_store(folder / "after.texmesh")->list().back();
  const std::size_t header = after.rfind("PK\3\4", credential.offset),
                    directory = credential.offset + credential.bytes;
  const std::size_t crc = after.rfind("PK\1\2") + 16;  // in the last central header
  EXPECT_EQ(before.substr(0, header), after.substr(0, header));
  EXPECT_EQ(before.substr(directory, crc - directory), after.substr(directory, crc - directory));
  EXPECT_NE(before.substr(crc, 4), after.substr(crc, 4));
  EXPECT_EQ(before.substr(crc + 4), after.substr(crc + 4));
}

TEST_F(Tree, ADamagedContentCredentialIsNotUnpacked) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  fs::create_directory(folder / "tree/META-INF");
  write_text((folder.path() / "tree" / kContentCredentialPath).string(), "not really signed");
  pack_folder(folder / "tree", folder / "signed.texmesh");
  std::string bytes = read_text(folder / "signed.texmesh");
  bytes[bytes.rfind("not really signed")] ^= 1;
  write_text(folder / "damaged.texmesh", bytes);
  EXPECT_THROW(unpack_package(folder / "damaged.texmesh", folder / "new", {}), FormatError);
}

TEST_F(Tree, PackAfterUnpackWithFragmentFiles) {
  unpack_package(folder / "a.texmesh", folder / "tree", {true, false});
  EXPECT_EQ(verify(folder / "tree"), "");
  EXPECT_EQ(files_beneath(folder / "tree").size(), 14u + 6 + 1);
  pack_folder(folder / "tree/", folder / "b.texmesh");
  EXPECT_EQ(read_text(folder / "b.texmesh"), text_of(package));
  for (std::uint32_t rung = 0; rung < 2; ++rung) fs::remove(fs::path(folder / "tree") / rung_path(0, rung));
  pack_folder(folder / "tree", folder / "c.texmesh");  // the rungs' entries are put together from the files
  EXPECT_EQ(read_text(folder / "c.texmesh"), text_of(package));
}

TEST_F(Tree, FragmentFilesAreCompleteJpegs) {
  unpack_package(folder / "a.texmesh", folder / "tree", {true, false});
  const std::string json = read_text(folder / "tree/fragments.json");
  const FragmentIndex index =
      read_fragment_index({reinterpret_cast<const std::uint8_t*>(json.data()), json.size()});
  EXPECT_EQ(index.planes.at(0).order, (std::vector<std::uint16_t>{1, 2, 0}));
  for (std::uint32_t rung = 0; rung < 2; ++rung)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::string jpeg = read_text(
          (fs::path(folder / "tree") / fragment_file_path(0, rung, index.planes[0].order[k])).string());
      EXPECT_EQ(jpeg.size(), index.planes[0].rungs.at(rung).bytes[k]);
      const Pixels p =
          decode_jpeg({reinterpret_cast<const std::uint8_t*>(jpeg.data()), jpeg.size()}, 1 << 20);
      EXPECT_EQ(p.width_px, 32u);
    }
}

TEST_F(Tree, SaysThatItHasNoFragmentFiles) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  EXPECT_EQ(read_text(folder / "tree/fragments.json"), "{\"version\":1,\"planes\":[]}");
  EXPECT_EQ(verify(folder / "tree"), "");
  const fs::path file = fs::path(folder / "tree") / fragment_file_path(0, 1, 2);
  fs::create_directories(file.parent_path());
  write_text(file.string(), "of something else");
  EXPECT_NE(verify(folder / "tree").find("[fragment-file]"), std::string::npos);
}

TEST_F(Tree, FragmentFilesThatDoNotFitAreFound) {
  unpack_package(folder / "a.texmesh", folder / "tree", {true, false});
  const std::string path = (fs::path(folder / "tree") / fragment_file_path(0, 1, 2)).string();
  std::string jpeg = read_text(path);
  jpeg[jpeg.size() / 2] ^= 1;
  write_text(path, jpeg);
  EXPECT_NE(verify(folder / "tree").find("[fragment-file]"), std::string::npos);
  fs::remove(path);
  EXPECT_NE(verify(folder / "tree")
                .find(fragment_file_path(0, 1, 2) + ": expected a file, found none [fragment-file]"),
            std::string::npos);
  fs::remove(folder / "tree/fragments.json");
  EXPECT_NE(verify(folder / "tree").find("expected a fragments.json beside fragment files"),
            std::string::npos);
}

TEST_F(Tree, ADamagedPackageLeavesNothing) {
  Bytes damaged =
      testing::PackagePatcher(package).edit(mesh_path(0), [](Bytes& b) { b[100] ^= 1; }).package();
  write_text(folder / "a.texmesh", text_of(damaged));
  EXPECT_THROW(unpack_package(folder / "a.texmesh", folder / "tree", {}), FormatError);
  expect_names({"a.texmesh"});
}

TEST_F(Tree, AnExistingFolderIsNeverMixed) {
  fs::create_directory(folder.path() / "tree");
  write_text(folder / "tree/mine.txt", "mine");
  EXPECT_THROW(unpack_package(folder / "a.texmesh", folder / "tree", {}), InputError);
  EXPECT_THROW(unpack_package(folder / "a.texmesh", folder / "tree", {false, true}),
               InputError);  // --force spares foreign folders
  EXPECT_THROW(unpack_package(folder / "a.texmesh", folder / "a.texmesh", {false, true}), InputError);
  EXPECT_EQ(read_text(folder / "tree/mine.txt"), "mine");
  fs::create_directory(folder.path() / "empty");
  unpack_package(folder / "a.texmesh", folder / "empty/", {});
  EXPECT_THROW(unpack_package(folder / "a.texmesh", folder / "empty", {}), InputError);
  write_text(folder / "empty/stale.bin", "from an older package");
  unpack_package(folder / "a.texmesh", folder / "empty", {false, true});
  EXPECT_EQ(verify(folder / "empty"), "");
  EXPECT_FALSE(fs::exists(folder / "empty/stale.bin"));
  expect_names({"a.texmesh", "empty", "tree"});
}

TEST_F(Tree, TheFolderCanBeRead) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  struct stat st {};
  ASSERT_EQ(::stat((folder / "tree").c_str(), &st), 0);
  EXPECT_EQ(st.st_mode & 0777u, 0755u);
}

TEST_F(Tree, PackRefusesWhatIsNotThePackage) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  const auto refused = [&](const std::string& what) {
    EXPECT_THROW(pack_folder(folder / "tree", folder / "b.texmesh"), FormatError) << what;
    EXPECT_FALSE(fs::exists(folder / "b.texmesh")) << what;
  };
  write_text(folder / "tree/notes.txt", "x");
  refused("a file that the index does not name");
  fs::remove(folder / "tree/notes.txt");
  fs::create_symlink("/etc/hostname", folder / "tree/link");
  refused("a symbolic link");
  fs::remove(folder / "tree/link");
  const std::string mesh = (fs::path(folder / "tree") / mesh_path(5)).string(), bytes = read_text(mesh);
  write_text(mesh, bytes + "x");
  refused("a longer file");
  std::string changed = bytes;
  changed[50] ^= 1;
  write_text(mesh, changed);
  refused("changed bytes");
  fs::remove(mesh);
  refused("a missing file");
  write_text(mesh, bytes);
  pack_folder(folder / "tree", folder / "b.texmesh");
  EXPECT_EQ(read_text(folder / "b.texmesh"), text_of(package));
}

TEST_F(Tree, VerifyNamesFilesThatAreMissingOrTooMany) {
  unpack_package(folder / "a.texmesh", folder / "tree", {});
  write_text(folder / "tree/notes.txt", "x");
  EXPECT_EQ(verify(folder / "tree"),
            "notes.txt: expected to be named by the index, found not there [entry-set] [I08]\n");
  fs::remove(folder / "tree/notes.txt");
  fs::remove(fs::path(folder / "tree") / mesh_path(5));
  EXPECT_NE(
      verify(folder / "tree")
          .find("mesh/s05.glb: expected an entry of the package, as the index says, found none [entry-set]"),
      std::string::npos);
}

TEST_F(Tree, ContainersWithPathsThatEscapeAreRefused) {
  // The writer refuses such names, so the name is put into a finished container.
  std::string evil = text_of(package);
  const std::string path = mesh_path(0), escape = "../../s0.glb";
  ASSERT_EQ(path.size(), escape.size());
  for (std::size_t at = 0; (at = evil.find(path, at)) != std::string::npos; at += path.size())
    evil.replace(at, path.size(), escape);
  write_text(folder / "a.texmesh", evil);
  EXPECT_THROW(unpack_package(folder / "a.texmesh", folder / "tree", {}), FormatError);
  EXPECT_NE(verify(folder / "a.texmesh").find("[container]"), std::string::npos);
  expect_names({"a.texmesh"});
}

}  // namespace texmesh::package_tree_test
