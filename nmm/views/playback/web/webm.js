// WebM files of one track of pictures: EBML elements (RFC 8794), as Matroska (RFC 9559) names them.
"use strict";
{
  const text = (value) => new TextEncoder().encode(value);
  const number = (value) => {
    const bytes = [];
    do bytes.unshift(value % 256);
    while ((value = Math.floor(value / 256)) > 0);
    return new Uint8Array(bytes);
  };
  const real = (value) => new Uint8Array(new Float64Array([value]).buffer).reverse();
  const joined = (parts) => {
    const all = new Uint8Array(parts.reduce((sum, part) => sum + part.length, 0));
    let at = 0;
    for (const part of parts) {
      all.set(part, at);
      at += part.length;
    }
    return all;
  };
  // Eight bytes for every length: one marks that it is so.
  const length = (size) => {
    const bytes = number(size);
    return joined([new Uint8Array([1]), new Uint8Array(7 - bytes.length), bytes]);
  };
  const element = (id, ...parts) => {
    const content = joined(parts);
    return joined([number(id), length(content.length), content]);
  };

  const head = () =>
    element(
      0x1a45dfa3,
      element(0x4286, number(1)), element(0x42f7, number(1)), element(0x42f2, number(4)), element(0x42f3, number(8)),
      element(0x4282, text("webm")), element(0x4287, number(4)), element(0x4285, number(2)),
    );
  // In ms: a timestamp scale of 10⁶ ns.
  const info = (duration) =>
    element(
      0x1549a966, element(0x2ad7b1, number(1000000)), element(0x4489, real(duration)),
      element(0x4d80, text("nmm")), element(0x5741, text("nmm")),
    );
  const tracks = ({ codec, width, height, fps }) =>
    element(0x1654ae6b, element(
      0xae,
      element(0xd7, number(1)), element(0x73c5, number(1)), element(0x83, number(1)), element(0x9c, number(0)),
      element(0x86, text(codec)), element(0x23e383, number(Math.round(1e9 / fps))),
      element(0xe0, element(0xb0, number(width)), element(0xba, number(height))),
    ));
  // Where clusters begin, after the first byte of the segment.
  const cues = (places) =>
    element(0x1c53bb6b, ...places.map(({ time, at }) =>
      element(0xbb, element(0xb3, number(time)), element(0xb7, element(0xf7, number(1)), element(0xf1, number(at))))));

  // pictures: {data, time [ms], key} in order; a cluster begins with each key. codec: V_VP8 or V_VP9.
  nmm.webm = (track, pictures) => {
    const clusters = [];
    for (const picture of pictures) {
      if (picture.key || clusters.length === 0) clusters.push({ time: picture.time, blocks: [] });
      const { time, blocks } = clusters[clusters.length - 1];
      const after = picture.time - time;
      blocks.push(element(0xa3, new Uint8Array([0x81, after >> 8, after & 255, picture.key ? 0x80 : 0]), picture.data));
    }
    const before = [info((1000 * pictures.length) / track.fps), tracks(track)];
    let at = before[0].length + before[1].length;
    const places = [];
    const made = clusters.map(({ time, blocks }) => {
      const cluster = element(0x1f43b675, element(0xe7, number(time)), ...blocks);
      places.push({ time, at });
      at += cluster.length;
      return cluster;
    });
    return new Blob([head(), element(0x18538067, ...before, ...made, cues(places))], { type: "video/webm" });
  };
}
