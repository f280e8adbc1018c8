"""Changes pictures for the tests: JPEG headers in place, and plain PNG files."""
import struct
import zlib

GPS_LATITUDE_REF, GPS_LATITUDE, GPS_LONGITUDE_REF, GPS_LONGITUDE = 1, 2, 3, 4
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

    def set_position(self, latitude, longitude):
        for value, tag, reference, letters in ((latitude, GPS_LATITUDE, GPS_LATITUDE_REF, b"NS"),
                                               (longitude, GPS_LONGITUDE, GPS_LONGITUDE_REF, b"EW")):
            self.data[self.start + self.gps[reference]] = letters[value < 0]
            struct.pack_into(self.order + "6I", self.data, self.start + self.gps[tag],
                             round(abs(value) * 10**7), 10**7, 0, 1, 0, 1)
        self.file.write_bytes(self.data)


def strip_exif(file):
    """Takes all APP1 segments (EXIF, XMP) out of a JPEG file."""
    data, at, kept = file.read_bytes(), 2, b"\xff\xd8"
    while data[at + 1] != 0xDA:
        length = 2 + struct.unpack_from(">H", data, at + 2)[0]
        if data[at + 1] != 0xE1:
            kept += data[at:at + length]
        at += length
    file.write_bytes(kept + data[at:])


def write_png(file, width, height, row):
    """A grey picture; row(y) gives the bytes of a row."""
    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    pixels = zlib.compressobj(1)
    with file.open("wb") as out:
        out.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)))
        packed = b"".join(pixels.compress(b"\0" + row(y)) for y in range(height)) + pixels.flush()
        out.write(chunk(b"IDAT", packed) + chunk(b"IEND", b""))
