/* An AVR with a firmware: its first serial line on a pseudo-terminal, the changes of its pins on stdout. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <simavr/avr_ioport.h>
#include <simavr/avr_uart.h>

static avr_t *avr;
static int master, may_send = 1;
static volatile int ended;

static void stop(int n) { (void)n; ended = 1; }

static void changed(struct avr_irq_t *irq, uint32_t value, void *name) {
    (void)irq;
    if (value > 1) return;
    printf("%.1f %s %u\n", avr->cycle * 1e6 / avr->frequency, (char *)name, value);
    fflush(stdout);
}
static void sent(struct avr_irq_t *irq, uint32_t value, void *p) {
    (void)irq; (void)p;
    uint8_t byte = value;
    while (write(master, &byte, 1) < 0 && errno == EAGAIN) usleep(100);
}
static void xon(struct avr_irq_t *irq, uint32_t value, void *p) { (void)irq; (void)value; (void)p; may_send = 1; }
static void xoff(struct avr_irq_t *irq, uint32_t value, void *p) { (void)irq; (void)value; (void)p; may_send = 0; }
static void sent1(struct avr_irq_t *irq, uint32_t value, void *p) {
    (void)irq; (void)p;
    printf("%.1f TX1 %u\n", avr->cycle * 1e6 / avr->frequency, value);
    fflush(stdout);
}

int main(int argc, char **argv) {
    if (argc < 3) return 2;
    elf_firmware_t f = {0};
    elf_read_firmware(argv[1], &f);
    avr = avr_make_mcu_by_name(argv[2]);
    if (!avr) return 2;
    avr_init(avr);
    f.frequency = 16000000;
    avr_load_firmware(avr, &f);
    avr->frequency = 16000000;
    int slave;
    char path[64];
    if (openpty(&master, &slave, path, 0, 0)) return 3;
    struct termios raw;
    tcgetattr(slave, &raw); cfmakeraw(&raw); tcsetattr(slave, TCSANOW, &raw);
    fcntl(master, F_SETFL, O_NONBLOCK);
    signal(SIGTERM, stop); signal(SIGINT, stop);
    uint32_t flags = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POOL_SLEEP);
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, 0);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), xon, 0);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), xoff, 0);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('1'), UART_IRQ_OUTPUT), sent1, 0);
    for (const char *p = "ABCDEFGHJKL"; *p; p++)
        for (int bit = 0; bit < 8; bit++) {
            avr_irq_t *irq = avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ(*p), bit);
            char *name = malloc(4);
            sprintf(name, "P%c%d", *p, bit);
            if (irq) avr_irq_register_notify(irq, changed, name);
        }
    printf("port %s\n", path);
    fflush(stdout);
    avr_irq_t *in = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    struct timespec t0; clock_gettime(CLOCK_MONOTONIC, &t0);
    uint64_t next = 0;
    while (!ended) {
        int state = avr_run(avr);
        if (state == cpu_Done || state == cpu_Crashed) { fprintf(stderr, "crashed\n"); return 1; }
        if (avr->cycle >= next) {
            next = avr->cycle + 16000000 / 11520;        /* one byte at 115200 baud */
            uint8_t byte;
            if (may_send && read(master, &byte, 1) == 1) avr_raise_irq(in, byte);
            struct timespec t; clock_gettime(CLOCK_MONOTONIC, &t);
            double real = (t.tv_sec - t0.tv_sec) + (t.tv_nsec - t0.tv_nsec) * 1e-9, sim = avr->cycle / 16e6;
            if (sim > real + 0.002) usleep(1000);         /* real time, or slower */
        }
    }
    return 0;
}
