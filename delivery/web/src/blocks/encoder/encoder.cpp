#include "delivery/web/src/blocks/encoder/block.h"

// What blocks/blocks.ts calls: pictures of RGBA bytes, row by row, in; blocks, row by row, out.

/** By number: blocks/formats.ts. */
static void (*const encoders[])(const Block*, u8*) = {
    encode_bc1, encode_bc3_normal, encode_bc5, encode_bc7, encode_etc2, encode_astc, encode_astc_normal};

static const u8 is_normal[] = {0, 1, 1, 0, 0, 0, 1};

/** Normals get length 1, so that two channels say the third: pictures of normals hold shorter ones wherever
 * they were filtered or coded. */
static void normalise(Block* block) {
  EACH(row, 4) {
    const f4 x = block->c[0][row] - 127.5f, y = block->c[1][row] - 127.5f,
             z = max4(block->c[2][row] - 127.5f, f4_of(0));
    const f4 scale = 127.5f / __builtin_wasm_sqrt_f32x4(max4(x * x + y * y + z * z, f4_of(1)));
    block->c[0][row] = x * scale + 127.5f;
    block->c[1][row] = y * scale + 127.5f;
  }
}

static void load(const u8* pixels, int width, int height, int x, int y, Block* block) {
  EACH(row, 4) {
    const int from = y + row < height ? y + row : height - 1;
    const u32* line = (const u32*)pixels + (long)from * width;
    i4 v;
    if (x + 4 <= width)
      __builtin_memcpy(&v, line + x, 16);
    else
      EACH(i, 4) v[i] = (int)line[x + i < width ? x + i : width - 1];
    EACH(c, 3) block->c[c][row] = __builtin_convertvector(v >> (8 * c) & 255, f4);
  }
}

/** `block_bytes` is 8 or 16. */
extern "C" __attribute__((export_name("encode"))) void encode(int format, int block_bytes, const u8* pixels,
                                                              int width, int height, u8* out) {
  prepare_bc1();
  prepare_astc();
  for (int y = 0; y < height; y += 4)
    for (int x = 0; x < width; x += 4, out += block_bytes) {
      Block block;
      load(pixels, width, height, x, y, &block);
      if (is_normal[format]) normalise(&block);
      encoders[format](&block, out);
    }
}

/** The next mip level, in place: means of 2 x 2 texels; a last odd row or column is left out, a single one
 * stands for two. */
extern "C" __attribute__((export_name("halve"))) void halve_picture(u8* pixels, int width, int height) {
  u8* out = pixels;
  const int columns = width > 1 ? width >> 1 : 1, rows = height > 1 ? height >> 1 : 1;
  EACH(y, rows) {
    const u8 *above = pixels + 8l * width * y, *below = height > 1 ? above + 4l * width : above;
    EACH(x, columns) EACH(c, 4) {
      const int left = 8 * x + c, right = width > 1 ? left + 4 : left;
      *out++ = (u8)((above[left] + above[right] + below[left] + below[right] + 2) >> 2);
    }
  }
}
