/* A meter that never forgets: pulses on RB0 are counted, the count lies twice in EEPROM; port A shows it. */
#pragma config FOSC = XT, WDTE = OFF, PWRTE = ON, CP = OFF
#include <xc.h>
#define _XTAL_FREQ 4000000

__EEPROM_DATA(0, 0, 0xFF, 0xFF, 'v', '1', 0, 0);

#define FIRST 0
#define SECOND 1

static unsigned char count;

static void keep(void)
{
    eeprom_write(FIRST, count);
    eeprom_write(SECOND, count);
}

void main(void)
{
    unsigned char old = 0;

    TRISA = 0;
    TRISB = 0xFF;
    count = eeprom_read(FIRST);
    if (count != eeprom_read(SECOND)) {    /* the supply failed between the two */
        count = eeprom_read(SECOND);
        keep();
    }
    PORTA = count;
    while (1) {
        unsigned char now = PORTBbits.RB0;
        if (now && !old) {
            count = (count + 1) & 0x0F;
            PORTA = count;
            keep();
        }
        old = now;
    }
}
