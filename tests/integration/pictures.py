"""Changes JPEG headers in place, and writes plain PNG files, for the tests."""
import struct
import zlib

GPS_LATITUDE_REF, GPS_LATITUDE, GPS_LONGITUDE_REF, GPS_LONGITUDE, GPS_ALTITUDE = 1, 2, 3, 4, 6
GPS_INFO = 0x8825


class Exif:
    """The EXIF entries of a JPEG file, to be read and overwritten in place."""

    def __init__(self, file):
        self.file, self.data = file, bytearray(file.read_bytes())
        self.start = self.data.index(b"Exif\0\0") + 6
        self.order = "<" if self.data[self.start:self.start + 2] == b"II" else ">"
        self.gps = self.directory(self.directory(self.at("I", self.start + 4))[GPS_INFO])

    def at(self, form, offset):
        return struct.unpack_from(self.order + form, self.data, offset)[0]

    def directory(self, offset):
        """Tag -> value or its offset, of short entries the place of the value itself behind the file's start."""
        first = self.start + offset
        entries = (first + 2 + 12 * i for i in range(self.at("H", first)))
        return {self.at("H", entry): self.at("I", entry + 8) if self.size(entry) > 4 or self.at("H", entry) == GPS_INFO
                else entry + 8 - self.start for entry in entries}

    def size(self, entry):
        return {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 7: 1, 9: 4, 10: 8}[self.at("H", entry + 2)] * self.at("I", entry + 4)

    def angle(self, tag):
        parts = [self.at("I", self.start + self.gps[tag] + 8 * i) / self.at("I", self.start + self.gps[tag] + 8 * i + 4)
                 for i in range(3)]
        return parts[0] + parts[1] / 60 + parts[2] / 3600

    def position(self):
        """Latitude and longitude, degrees."""
        sign = {tag: -1 if self.data[self.start + self.gps[tag]] in b"SW" else 1
                for tag in (GPS_LATITUDE_REF, GPS_LONGITUDE_REF)}
        return (sign[GPS_LATITUDE_REF] * self.angle(GPS_LATITUDE), sign[GPS_LONGITUDE_REF] * self.angle(GPS_LONGITUDE))

    def height(self):
        """Metres."""
        return self.at("I", self.start + self.gps[GPS_ALTITUDE]) / self.at("I", self.start + self.gps[GPS_ALTITUDE] + 4)

    def set_position(self, latitude, longitude):
        for value, tag, reference, letters in ((latitude, GPS_LATITUDE, GPS_LATITUDE_REF, b"NS"),
                                               (longitude, GPS_LONGITUDE, GPS_LONGITUDE_REF, b"EW")):
            self.data[self.start + self.gps[reference]] = letters[value < 0]
            struct.pack_into(self.order + "6I", self.data, self.start + self.gps[tag],
                             round(abs(value) * 10**7), 10**7, 0, 1, 0, 1)
        self.file.write_bytes(self.data)


def segments(data):
    """Marker and bytes of the segments of a JPEG file before its pixels."""
    at = 2
    while data[at + 1] != 0xDA:
        length = 2 + struct.unpack_from(">H", data, at + 2)[0]
        yield data[at + 1], data[at:at + length]
        at += length


def strip_exif(file):
    """Takes all APP1 segments (EXIF, XMP) out of a JPEG file."""
    data = file.read_bytes()
    every = list(segments(data))
    pixels = data[2 + sum(len(each) for _, each in every):]
    file.write_bytes(b"\xff\xd8" + b"".join(kept for marker, kept in every if marker != 0xE1) + pixels)


def make_blank(file, width, height):
    """Keeps the APP1 segments (EXIF, XMP) of a JPEG file and makes all its pixels middle grey."""
    def segment(marker, content):
        return b"\xff" + bytes([marker]) + struct.pack(">H", 2 + len(content)) + content

    one_code = bytes([1] + [0] * 15 + [0])  # of one bit, which says: no difference to the block before; no more terms
    blank = [kept for marker, kept in segments(file.read_bytes()) if marker == 0xE1]
    blank += [segment(0xDB, b"\0" + b"\x01" * 64),
              segment(0xC0, struct.pack(">BHHB", 8, height, width, 1) + b"\x01\x11\0"),
              segment(0xC4, b"\0" + one_code), segment(0xC4, b"\x10" + one_code),
              segment(0xDA, b"\x01\x01\0\0\x3f\0")]
    blocks = -(-width // 8) * -(-height // 8)
    file.write_bytes(b"\xff\xd8" + b"".join(blank) + b"\0" * -(-blocks // 4) + b"\xff\xd9")


def write_png(file, width, height, row, bits=8):
    """Writes a grey image; row(y) gives the bytes of a row."""
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    pixels = zlib.compressobj(1)
    with file.open("wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, bits, 0, 0, 0, 0)))
        packed = b"".join(pixels.compress(b"\0" + row(y)) for y in range(height)) + pixels.flush()
        out.write(chunk(b"IDAT", packed) + chunk(b"IEND", b""))
