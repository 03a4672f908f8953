/* Gives a program a /dev/i2c-N that leads to the simulator: LD_PRELOAD this, with I2C_SHIM_DEVICE
 * the device file and I2C_SHIM_SOCKET the simulator's socket.
 *
 * An open device is a connection to the simulator. Its ioctls are turned into I2C messages as the
 * kernel's i2c-core-smbus.c does for an adapter that knows plain I2C only. Nothing here is shared
 * with the Python stand-in, so that each can be held against the other.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <endian.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/i2c-dev.h>
#include <linux/i2c.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#define FDS 1024
#define MOST 65536

static int is_device[FDS];
static int slave[FDS];

static int is_ours(const char *path)
{
    const char *device = getenv("I2C_SHIM_DEVICE");
    return path && device && !strcmp(path, device);
}

static int fail(int number)
{
    errno = number;
    return -1;
}

static int connect_device(void)
{
    struct sockaddr_un name = {.sun_family = AF_UNIX};
    const char *path = getenv("I2C_SHIM_SOCKET");
    int fd;

    if (!path || strlen(path) >= sizeof name.sun_path)
        return fail(ENOENT);
    strcpy(name.sun_path, path);
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || fd >= FDS || connect(fd, (struct sockaddr *)&name, sizeof name) < 0)
        return fail(ENXIO);
    is_device[fd] = 1;
    slave[fd] = -1;
    return fd;
}

static int transport(int fd, uint8_t *data, size_t length, int sending)
{
    while (length) {
        ssize_t done = sending ? send(fd, data, length, MSG_NOSIGNAL) : recv(fd, data, length, 0);
        if (done <= 0)
            return fail(EIO);
        data += done;
        length -= done;
    }
    return 0;
}

/* Carry out one transaction; what was read is put into the messages' own buffers. */
static int transfer(int fd, struct i2c_msg *messages, int count)
{
    static __thread uint8_t buffer[MOST];
    uint8_t *end = buffer + 4;
    size_t wanted = 2;
    uint32_t length;
    uint16_t number;

    for (int i = 0; i < count; i++) {
        struct i2c_msg *m = messages + i;
        int reads = m->flags & I2C_M_RD;
        if (end + 5 + m->len > buffer + MOST)
            return fail(EINVAL);
        *end++ = m->addr >> 8;
        *end++ = m->addr & 0xff;
        *end++ = reads ? 1 : 0;
        *end++ = m->len >> 8;
        *end++ = m->len & 0xff;
        if (reads) {
            wanted += m->len;
        } else {
            memcpy(end, m->buf, m->len);
            end += m->len;
        }
    }
    length = htobe32(end - buffer - 4);
    memcpy(buffer, &length, 4);
    if (transport(fd, buffer, end - buffer, 1) || transport(fd, buffer, 4, 0))
        return -1;
    memcpy(&length, buffer, 4);
    length = be32toh(length);
    if (length < 2 || length > MOST || transport(fd, buffer, length, 0))
        return fail(EIO);
    memcpy(&number, buffer, 2);
    if (number)
        return fail(be16toh(number));
    if (length != wanted)
        return fail(EPROTO);
    end = buffer + 2;
    for (int i = 0; i < count; i++)
        if (messages[i].flags & I2C_M_RD) {
            memcpy(messages[i].buf, end, messages[i].len);
            end += messages[i].len;
        }
    return 0;
}

static int smbus(int fd, struct i2c_smbus_ioctl_data *call)
{
    uint8_t out[I2C_SMBUS_BLOCK_MAX + 3] = {call->command}, in[I2C_SMBUS_BLOCK_MAX] = {0};
    union i2c_smbus_data *data = call->data;
    int reads = call->read_write == I2C_SMBUS_READ, result;
    struct i2c_msg m[2] = {{slave[fd], 0, 1, out}, {slave[fd], I2C_M_RD, 0, in}};

    switch (call->size) {
    case I2C_SMBUS_QUICK:
        m[0].len = 0;
        m[0].flags = reads ? I2C_M_RD : 0;
        return transfer(fd, m, 1);
    case I2C_SMBUS_BYTE:
        m[1].len = 1;
        result = reads ? transfer(fd, m + 1, 1) : transfer(fd, m, 1);
        if (!result && reads)
            data->byte = in[0];
        return result;
    case I2C_SMBUS_BYTE_DATA:
    case I2C_SMBUS_WORD_DATA:
        m[1].len = call->size == I2C_SMBUS_BYTE_DATA ? 1 : 2;
        if (!reads) {
            out[1] = data->byte;
            out[2] = data->word >> 8;
            m[0].len += m[1].len;
            if (m[1].len == 2)
                out[1] = data->word & 0xff;
            return transfer(fd, m, 1);
        }
        result = transfer(fd, m, 2);
        if (!result && m[1].len == 1)
            data->byte = in[0];
        else if (!result)
            data->word = in[0] | in[1] << 8;
        return result;
    case I2C_SMBUS_I2C_BLOCK_BROKEN: /* its older number, which reads 32 bytes always */
        if (reads)
            data->block[0] = I2C_SMBUS_BLOCK_MAX;
        /* fall through */
    case I2C_SMBUS_I2C_BLOCK_DATA:
        if (data->block[0] < 1 || data->block[0] > I2C_SMBUS_BLOCK_MAX)
            return fail(EINVAL);
        m[1].len = data->block[0];
        if (!reads) {
            memcpy(out + 1, data->block + 1, data->block[0]);
            m[0].len += data->block[0];
            return transfer(fd, m, 1);
        }
        result = transfer(fd, m, 2);
        if (!result)
            memcpy(data->block + 1, in, data->block[0]);
        return result;
    }
    return fail(EOPNOTSUPP);
}

static int device_ioctl(int fd, unsigned long request, void *argument)
{
    struct i2c_rdwr_ioctl_data *many = argument;

    switch (request) {
    case I2C_FUNCS:
        *(unsigned long *)argument = I2C_FUNC_I2C | I2C_FUNC_SMBUS_QUICK | I2C_FUNC_SMBUS_BYTE
            | I2C_FUNC_SMBUS_BYTE_DATA | I2C_FUNC_SMBUS_WORD_DATA | I2C_FUNC_SMBUS_I2C_BLOCK;
        return 0;
    case I2C_SLAVE:
    case I2C_SLAVE_FORCE:
        if ((unsigned long)argument > 0x7f)
            return fail(EINVAL);
        slave[fd] = (int)(unsigned long)argument;
        return 0;
    case I2C_SMBUS:
        return smbus(fd, argument);
    case I2C_RDWR:
        if (many->nmsgs < 1 || many->nmsgs > I2C_RDWR_IOCTL_MAX_MSGS)
            return fail(EINVAL);
        return transfer(fd, many->msgs, many->nmsgs) ? -1 : (int)many->nmsgs;
    case I2C_TIMEOUT:
    case I2C_RETRIES:
        return 0;
    }
    return fail(ENOTTY);
}

/* What programs call: everything that is not ours goes to the C library. */

#define REAL(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))

static int open_any(const char *symbol, const char *path, int flags, mode_t mode)
{
    if (is_ours(path))
        return connect_device();
    return ((int (*)(const char *, int, ...))dlsym(RTLD_NEXT, symbol))(path, flags, mode);
}

#define OPEN(name)                                        \
    int name(const char *path, int flags, ...)            \
    {                                                     \
        va_list more;                                     \
        mode_t mode;                                      \
        va_start(more, flags);                            \
        mode = va_arg(more, mode_t);                      \
        va_end(more);                                     \
        return open_any(#name, path, flags, mode);        \
    }
OPEN(open)
OPEN(open64)

int __open_2(const char *path, int flags) { return open_any("open", path, flags, 0); }
int __open64_2(const char *path, int flags) { return open_any("open64", path, flags, 0); }

int stat(const char *path, struct stat *found)
{
    return REAL(stat)(is_ours(path) ? "/dev/null" : path, found);
}

int stat64(const char *path, struct stat64 *found)
{
    return REAL(stat64)(is_ours(path) ? "/dev/null" : path, found);
}

int access(const char *path, int mode)
{
    return REAL(access)(is_ours(path) ? "/dev/null" : path, mode);
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list more;
    void *argument;

    va_start(more, request);
    argument = va_arg(more, void *);
    va_end(more);
    if (fd >= 0 && fd < FDS && is_device[fd])
        return device_ioctl(fd, request, argument);
    return ((int (*)(int, unsigned long, ...))dlsym(RTLD_NEXT, "ioctl"))(fd, request, argument);
}

int close(int fd)
{
    if (fd >= 0 && fd < FDS)
        is_device[fd] = 0;
    return REAL(close)(fd);
}
