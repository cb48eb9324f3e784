#pragma once
// For jpeg*.cpp only: how libjpeg's errors become ours without an exception or a longjmp crossing the wrong
// frames.
#include <csetjmp>
#include <cstdio>

#include <jpeglib.h>

namespace texmesh {

struct JpegErrors {
  jpeg_error_mgr base;  // first: libjpeg hands back a pointer to it
  std::jmp_buf jump;
  char message[JMSG_LENGTH_MAX] = {};

  JpegErrors() {
    jpeg_std_error(&base);
    base.error_exit = fail;
    base.emit_message = [](j_common_ptr info, int level) {
      if (level < 0) fail(info);  // a warning: the data are damaged and libjpeg would go on with a guess
    };
    base.output_message = [](j_common_ptr) {};
  }

 private:
  [[noreturn]] static void fail(j_common_ptr info) {
    auto* self = reinterpret_cast<JpegErrors*>(info->err);
    self->base.format_message(info, self->message);
    std::longjmp(self->jump, 1);
  }
};

/// Runs body(); false when libjpeg failed, with the reason in errors.message. libjpeg is C and leaves by
/// longjmp, so the body must own nothing: no automatic object with a destructor may live in it while it calls
/// libjpeg.
template <class Body>
bool jpeg_guarded(JpegErrors& errors, Body&& body) {
  if (setjmp(errors.jump)) return false;
  body();
  return true;
}

}  // namespace texmesh
